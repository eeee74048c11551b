"""A servo arm that logs goals and no torque: from dropped files to the actuators taken along."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.browser.page import button, charts, press, row, status, tab, until, well_laid_out
from tests.browser.test_own_robot import MOST_PRESSES, PRESSES, drag, form, says
from tests.independent.servo_simulator import Servo
from tests.servo_sets import pendulum_set

pytestmark = pytest.mark.browser


def write_logs(folder: Path) -> list[Path]:
    """The files that a stranger has: a URDF, and a log of goals and positions per motion."""
    servo = Servo(effects={"coulomb_friction": (0.3,)})
    measurements = pendulum_set(folder, servo, seconds=8.0)
    files = [folder / "pendulum.urdf"]
    for group in measurements.groups:
        assert group.theta_ref is not None
        columns = {
            "time": group.joined("time"),
            "present_position.hinge": group.joined("theta")[:, 0],
            "goal_position.hinge": group.theta_ref[:, 0],
        }
        files.append(folder / f"{group.name}.csv")
        rows = np.stack(list(columns.values()), axis=1)
        np.savetxt(files[-1], rows, "%.9g", ",", header=",".join(columns), comments="")
    return files


def test_from_goals_to_the_actuators(
    serve: Callable[..., str], open_page: Any, shot: Any, tmp_path: Path
) -> None:
    files = write_logs(tmp_path)
    page = open_page(serve())
    page.evaluate(PRESSES)
    drag(page, *files)
    says(page, "Checked: the joints follow these goals.")
    assert "goal_position" in page.locator(".fv-own").inner_text() and "no column" not in form(page)
    shot(page, "servos-form")
    button(page, "Open").click()
    says(page, "goals of servos, no torque recorded; kp estimated")
    shot(page, "servos-opened")
    button(page, "Diagnose").click()
    button(page, "Find the missing effect").click()
    says(page, "Missing: Coulomb friction")
    assert "% of the following error" in status(page)
    shot(page, "servos-found")
    press(page, "Add all found", lambda: "+ Coulomb friction" in form(page))
    says(page, "Export model, takes the model along")
    button(page, "Identify").click()
    until(lambda: row(page, "kp [Nm/rad]").get_by_role("textbox").count() == 1)
    shot(page, "servos-identified")
    for name, title in (
        ("Signals", "Goal − position, hinge"),
        ("Where it fails", "Residual of hinge against velocity"),
        ("Compare", "Simulated − measured θ, hinge"),
    ):
        tab(page, name).click()
        until(lambda title=title: any(one.startswith(title) for one in charts(page)), what=title)
        assert not [one for one in charts(page) if "orque" in one or "Nm]" in one], name
    assert "goal − θ [rad]" in page.locator(".fv-joints").inner_text()
    well_laid_out(page)
    button(page, "Data").click()
    with page.expect_download() as download:
        button(page, "Export model").click()
    presses = 1 + page.evaluate("window.presses")  # and the drop
    assert presses <= MOST_PRESSES, presses
    file = tmp_path / download.value.suggested_filename
    download.value.save_as(file)
    with zipfile.ZipFile(file) as archive:
        read = {Path(name).name: archive.read(name).decode() for name in archive.namelist()}
    gain = float(re.findall(r'kp="([\d.]+)"', read["pendulum.xml"])[0])
    assert gain == pytest.approx(10.0, rel=0.1)
    assert "ImplicitActuatorCfg" in read["pendulum_actuators.py"] and "pendulum_bam.json" in read
    shot(page, "servos-exported")
