"""What a diagnosis offers: several effects at once, the motion that decides, the free curve."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from flexviz.analysis.diagnosis import Diagnosis, prediction_errors
from flexviz.analysis.identification import identify
from flexviz.base.resources import sessions_dir
from flexviz.content.session import Session, save_session
from flexviz.data.measurements import read_set
from flexviz.outlets.app import DEMO
from tests.browser.page import (
    SOON,
    button,
    error,
    leave_the_plots,
    pause,
    pin,
    press,
    row,
    status,
    tab,
    until,
    well_laid_out,
)
from tests.found import COULOMB, CURVE, DIAGNOSIS

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session on the demonstration set: an unknown residual, and then friction on both joints."""
    measurements = read_set(sessions_dir() / DEMO)
    session, result = Session.of(measurements), identify(measurements)
    analysis = session.analysis.with_identification(result, session.analysis.settings)
    errors = prediction_errors(measurements, result.model)
    first = replace(
        DIAGNOSIS.steps[0],
        rms=errors.rms,
        rms_validation=errors.rms_validation,
        groups=errors.groups,
        noise_floor=errors.noise_floor,
        model=result.model,
    )

    curve = replace(
        CURVE, directions=("forward", "backward"), value=CURVE.value[[0, 0]], std=CURVE.std[[0, 0]]
    )

    def found(**changes: Any) -> Diagnosis:
        return replace(DIAGNOSIS, set_name=measurements.name, model=result.model, notes=(), **changes)

    unknown = found(
        verdict="unknown", findings=(), steps=(replace(first, verdict="unknown"),), free_curve=curve
    )
    both = (COULOMB, replace(COULOMB, joint="joint1", inseparable_from=(), evidence=None))
    missing = found(findings=both, steps=(first,), free_curve=None)
    session = session.then("looked", analysis.with_diagnosis(unknown))
    session = session.then("looked again", analysis.with_diagnosis(missing))
    return save_session(session, measurements, tmp_path_factory.mktemp("diagnosed") / "session")


@pytest.mark.slow
def test_what_a_diagnosis_offers(
    diagnosed: Path, serve: Callable[..., str], open_page: Any, shot: Any, tmp_path: Path
) -> None:
    page = open_page(serve(str(diagnosed)), 1280, 800)
    pause(page)
    pin(page)
    button(page, "Diagnose").click()
    # effects of one kind are one finding with one button
    finding = page.locator(".fv-finding:visible")
    until(lambda: finding.count() == 1, what="the finding")
    assert "1. Coulomb friction on joints 1 and 2" in finding.inner_text()
    until(page.get_by_role("button", name="Add and refit").first.is_enabled, SOON, "a way to add it")

    # a tie offers the motion that decides; stopped, it is the best one so far, as files
    press(page, "Motion that would decide", lambda: "designing, " in status(page))
    button(page, "Stop").click()
    until(lambda: "best motion so far" in status(page), what="the motion")
    until(lambda: "expected" in page.inner_text("body"), SOON, "what it promises")
    well_laid_out(page)
    shot(page, "deciding")
    with page.expect_download(timeout=60_000) as download:
        button(page, "Download the motion").click()
    download.value.save_as(tmp_path / "motion.zip")
    with zipfile.ZipFile(tmp_path / "motion.zip") as packed:
        assert {"d1.csv", "d1.yaml", "summary.txt"} <= set(packed.namelist())

    # a verdict belongs to one model, observer and data: of another observer it is struck through
    verdict = page.locator(".fv-verdict")
    assert page.locator(".fv-verdict s").count() == 0
    button(page, "Observer").click()
    typed = row(page, "exactly").get_by_role("textbox")
    typed.fill("80")
    typed.press("Enter")
    button(page, "Identify").click()
    button(page, "Run").click()
    until(lambda: "iterations in" in status(page), what="a result")
    tab(page, "Compare").click()
    until(lambda: ", 80 rad/s ● shown" in page.inner_text("body"), what="the run in the staircase")
    button(page, "Diagnose").click()
    until(lambda: page.locator(".fv-verdict s").count() == 1, SOON, "the verdict struck through")
    assert "look again" in verdict.inner_text()
    assert "Done" not in page.locator(".fv-steps").inner_text()
    assert "What is left" not in page.inner_text("body") and finding.count() == 0
    shot(page, "stale")
    well_laid_out(page)
    for action in ("identified", "bandwidth"):
        press(page, "Undo", lambda action=action: f"undone: {action}" in status(page))
    until(lambda: page.locator(".fv-verdict s").count() == 0, what="the verdict again")

    # under "Unknown" the free curve is added as a hatched step, and taken back
    button(page, "Undo").click()
    until(lambda: verdict.inner_text().startswith("Unknown:"), what="the verdict before")
    tab(page, "Compare").click()
    offered, known = page.get_by_role("button", name="Add the free curve"), error(page)
    assert known > 1
    press(page, "Add the free curve", lambda: "free curve" in status(page))
    until(lambda: page.locator(".fv-stair.hatched").count() == 1, what="the hatched step")
    assert "(not physics)" in page.inner_text("body")
    leave_the_plots(page)
    shot(page, "free-curve")
    well_laid_out(page)
    button(page, "Undo").click()
    until(lambda: offered.is_visible() and error(page) == known, what="the undo")
