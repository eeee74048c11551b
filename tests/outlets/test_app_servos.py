"""The app on a set of goals: what is offered, what is stated of the servos, what is exported."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from app_running import control, running, shown, status, until, use, wait

from flexviz.content.session import Analysis, open_session, save_session
from flexviz.data.measurements import Drive, write_set
from flexviz.outlets.app.application import Application
from flexviz.outlets.app.sets import chosen_set
from flexviz.outlets.app.steps.servos import typed_joints
from flexviz.outlets.app.workspace import ExportModel
from tests.independent.servo_simulator import Servo
from tests.servo_sets import arm_set


@pytest.fixture(scope="module")
def app(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Application]:
    folder = tmp_path_factory.mktemp("servos")
    servo = Servo(effects={"coulomb_friction": (0.3,)})
    measurements = arm_set(folder, [servo, servo], seconds=6.0)
    write_set(folder / "arm", measurements)
    with running(folder, folder / "arm") as application:
        yield application


def test_servos_are_offered_what_they_can_have(app: Application) -> None:
    boxes = app.dock.steps[2].effects.boxes  # type: ignore[attr-defined]
    assert boxes["goal_delay"].visible and boxes["coulomb_friction"].visible
    assert not boxes["link_coulomb_friction"].visible and not control(app, "Refine").visible
    assert "no observer has to" in shown(app) and control(app, "Deflection ×").disabled
    assert "BAM" in control(app, "Export as").options and "C" not in control(app, "Export as").options


def test_what_is_stated_of_servos_is_fitted_and_undone(app: Application) -> None:
    joints = app.store.measurements.joints
    use(app, "Coulomb friction")
    use(app, "All servos alike")
    assert app.store.analysis.drive == Drive(None, (joints,))
    assert control(app, "Alike joints").value == "shoulder, elbow"
    use(app, "kp [Nm/rad]", "10, x")
    assert "kp: found '10, x'" in shown(app, "fv-warn") and app.store.analysis.drive == Drive(None, (joints,))
    use(app, "kp [Nm/rad]", "10")
    assert chosen_set(app.store.analysis).drive == Drive((10.0, 10.0), (joints,))
    use(app, "Run")
    wait(app)
    result = app.store.analysis.identification
    assert result is not None and app.store.analysis.up_to_date
    gains = [p for p in result.parameters if p.name == "position_control.gain"]
    assert [p.value for p in gains] == pytest.approx([10.0, 10.0])
    until(app, lambda: "% of the following error" in status(app))
    until(app, lambda: bool(app.store.maps))
    assert "torque" not in shown(app, "fv-joints")
    use(app, "kp [Nm/rad]", "")
    assert not app.store.analysis.up_to_date
    app.store.undo()
    assert control(app, "kp [Nm/rad]").value == "10" and app.store.analysis.up_to_date


def test_a_session_keeps_what_is_stated(app: Application, tmp_path: Path) -> None:
    if not app.store.analysis.up_to_date:  # in another process than the test above
        use(app, "All servos alike")
        use(app, "Run")
        wait(app)
    folder = save_session(app.store.session, app.store.measurements, tmp_path / "kept")
    kept: Analysis = open_session(folder).session.analysis
    assert kept.drive == app.store.analysis.drive and kept.up_to_date
    made = ExportModel(kept, app.store.measurements, "isaac").run(lambda _: None, lambda: False)
    assert made.name == "arm_actuators.py" and b"ImplicitActuatorCfg" in made.content
    made = ExportModel(kept, app.store.measurements, "").run(lambda _: None, lambda: False)
    assert made.name == "arm-export.zip" and any("does not contain" in line for line in made.left_out)


def test_typed_joints() -> None:
    assert typed_joints("a, b; c d", ("a", "b", "c", "d")) == (("a", "b"), ("c", "d"))
    assert typed_joints("", ("a", "b")) == ()
    for text in ("a", "a, a", "a, x", "a, b; b, c"):
        with pytest.raises(ValueError, match="expected joints with commas"):
            typed_joints(text, ("a", "b", "c"))
