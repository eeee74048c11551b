"""The whole application without a browser: events in, what is on the screen out."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pytest

from flexviz.base.resources import sessions_dir
from flexviz.content.view import COMMON_EFFECTS, SERVO_ONLY
from flexviz.content.view.fit_charts import SWEEP_COUNT
from flexviz.model.effects import EFFECTS
from flexviz.outlets.app import DEMO
from flexviz.outlets.app.application import Application
from flexviz.outlets.app.sets import sets_beside
from flexviz.outlets.app.steps.data import DataStep
from flexviz.outlets.app.steps.identify import IdentifyStep
from flexviz.outlets.app.steps.observer import ObserverStep
from flexviz.outlets.app.steps.step import WorkflowStep
from flexviz.outlets.app.tasks import Identify, Sweep
from tests.app_running import (
    act,
    chart,
    command,
    control,
    off,
    reopen,
    running,
    send,
    settle,
    shown,
    status,
    until,
    use,
    wait,
)
from tests.small_set import write_small_set

AnyStep = TypeVar("AnyStep", bound=WorkflowStep)
KUKA = Path(__file__).resolve().parents[3] / "shared" / "real" / "kuka_kr300"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("app")
    write_small_set(root / "other")
    return write_small_set(root / "small")


@pytest.fixture(scope="module")
def server(folder: Path) -> Iterator[Application]:
    with running(folder.parent, folder) as application:
        yield application


@pytest.fixture
def app(server: Application, folder: Path) -> Application:
    """On the small set, whatever the test before has opened."""
    if server.store.measurements.name != folder.name:
        reopen(server, folder)
    return server


def step(app: Application, kind: type[AnyStep]) -> AnyStep:
    return next(step for step in app.dock.steps if isinstance(step, kind))


def playback_buttons(app: Application) -> Any:
    return next(
        handle
        for handle in app.page.gui._gui_input_handle_from_uuid.values()
        if "Step ▶" in getattr(handle, "options", ())
    )


def pause(app: Application) -> None:
    """Press the one button that plays and pauses, if it plays."""
    app.playback_panel._show_state()
    if app.store.clock.playing:
        send(app, playback_buttons(app), "Pause")
    assert not app.store.clock.playing and playback_buttons(app).options[0] == "Play"


def leave_controls(app: Application) -> None:
    """As if no control had been used for a while."""
    app.page.commands.touched(0.0)


def test_starts_playing_and_says_where_one_is(app: Application) -> None:
    assert app.store.clock.playing
    assert "Step Data" in status(app) and "no model yet" in status(app)
    frames = app.display.playback.frames
    until(app, lambda: app.display.playback.frames > frames + 5)
    for column in (chart(app, "signals", "torque"), chart(app, "states", "theta4")):
        assert all(np.isfinite(values).all() and len(values) <= 600 for values in column)


def test_bandwidth_redraws_the_states(app: Application) -> None:
    before = chart(app, "states", "theta3")[1]
    use(app, "Bandwidth [rad/s]", np.log10(120.0))
    after = chart(app, "states", "theta3")[1]
    assert len(before) != len(after) or not np.array_equal(before, after)
    assert app.store.analysis.fit.bandwidth == pytest.approx(120.0, rel=1e-3)
    assert "120" in shown(app)
    use(app, "Observer type", "eso")
    assert "disturbance" in app.plots._states._charts
    use(app, "Use the observer's own bandwidth")
    assert app.store.analysis.fit.bandwidth is None
    for _ in range(3):
        app.store.undo()
    assert app.store.analysis.fit.observer == "butterworth-zero-phase"


def test_undo_takes_back_one_whole_drag(app: Application, monkeypatch: pytest.MonkeyPatch) -> None:
    before = app.store.analysis.fit.bandwidth
    for width in (60.0, 70.0, 80.0):
        use(app, "Bandwidth [rad/s]", np.log10(width))
    monkeypatch.setattr("flexviz.outlets.app.store.PAUSE", 0.0)  # as if the slider had rested
    use(app, "Bandwidth [rad/s]", np.log10(200.0))
    app.store.undo()
    assert app.store.analysis.fit.bandwidth == pytest.approx(80.0, rel=0.01)
    app.store.undo()
    assert app.store.analysis.fit.bandwidth == before


def test_joint_and_group_are_selected_everywhere(app: Application) -> None:
    torque = chart(app, "signals", "torque")[1]
    use(app, "Joint", "joint2")
    assert app.store.joint == 1 and not np.array_equal(torque, chart(app, "signals", "torque")[1])
    app.display._clicked(0)
    app.once(0.0)
    assert control(app, "Joint").value == "joint1"
    use(app, "Group", "g3")
    assert app.store.group.name == "g3" and control(app, "Group").value == "g3"
    use(app, "Group", "g1")


def test_steps_show_their_controls(app: Application) -> None:
    buttons = app.dock._buttons
    for step in ("Observer", "Identify", "Diagnose", "Data"):
        send(app, buttons, step)
        assert [part.title for part in app.dock.steps if part.folder.visible] == [step]
        assert f"Step {step}" in status(app)


def test_roles_and_effects_are_in_the_history(app: Application) -> None:
    send(app, step(app, DataStep)._roles["g1"], "Ignore")
    send(app, step(app, DataStep)._roles["g2"], "Validate")
    assert off(app, "Run") and "No group" in shown(app, "No group")
    app.store.undo()
    app.store.undo()
    assert step(app, DataStep)._roles["g1"].value == "Fit" and not off(app, "Run")
    use(app, "Torque offset", True)
    assert app.store.analysis.effects == ("torque_offset",)
    app.store.undo()
    assert not step(app, IdentifyStep).effects.boxes["torque_offset"].value
    assert step(app, IdentifyStep).effects.boxes["coulomb_friction"].disabled  # the set's own


def test_every_command_has_a_key_of_its_own_and_does_something(app: Application) -> None:
    known = app.page.commands.known.values()
    assert len(known) == len(app.page.gui._command_handle_from_uuid) == 34
    hotkeys = [(known.hotkey, known.modifier) for known in known if known.hotkey]
    assert len(set(hotkeys)) == len(hotkeys) == 12
    leave_controls(app)  # a key at the same time as a control would be the control's
    for label, seen in (
        ("Go to step Identify", lambda: app.store.step == "Identify"),
        ("Choose the next joint", lambda: app.store.joint == 1),
        ("Choose the next group", lambda: app.store.group.name == "g2"),
        ("Change the layout of the robots", lambda: app.store.view.layout == "Overlaid"),
        ("Use the sweep's best bandwidth", lambda: "nothing has been swept yet" in status(app)),
        ("Add the best finding and refit", lambda: "there are no findings" in status(app)),
        ("Send a report", lambda: "no results yet" in status(app)),
    ):
        command(app, label)
        until(app, seen)
    for label in (
        "Go to step Data",
        "Choose the next joint",
        "Choose the next group",
        "Choose the next group",
        "Change the layout of the robots",
    ):
        command(app, label)
    until(app, lambda: app.store.view.layout == "Side by side" and app.store.group.name == "g1")


def test_playback_controls(app: Application) -> None:
    pause(app)
    use(app, "Time [s]", 1.5)
    assert app.store.clock.time == pytest.approx(1.5)
    send(app, playback_buttons(app), "Step ▶")
    assert app.store.clock.time == pytest.approx(1.5 + 1 / 30)
    leave_controls(app)
    command(app, "Play or pause")
    until(app, lambda: app.store.clock.playing)
    use(app, "Speed", "2×")
    use(app, "Layout", "Overlaid")
    use(app, "Layout", "Side by side")
    frames = app.display.playback.frames
    until(app, lambda: app.display.playback.frames - frames > 15)


def test_a_key_that_a_focused_slider_takes_does_not_step(app: Application) -> None:
    pause(app)
    use(app, "Time [s]", 1.0)
    command(app, "Step forward")
    use(app, "Deflection ×", 5)
    settle(app)
    assert app.store.clock.time == pytest.approx(1.0)
    leave_controls(app)
    command(app, "Step forward")
    use(app, "Canvas", "a.1 800 600 0")  # the page's script reports at any time, which takes no key
    settle(app)
    assert app.store.clock.time == pytest.approx(1.0 + 1 / 30)


def test_the_bar_of_a_narrow_page_plays_steps_and_seeks(app: Application) -> None:
    pause(app)
    for text, instant in (
        ("a.1 seek 1.25", 1.25),
        ("a.2 forward", 1.25 + 1 / 30),
        ("a.3 back", 1.25),
        ("a.4 seek 1e9", 1.25),  # no plain number
        ("a.5 jump 2", 1.25),
        ("", 1.25),
    ):
        use(app, "Playback command", text)
        assert app.store.clock.time == pytest.approx(instant)
    assert "nothing that the playback can do" in status(app)
    use(app, "Playback command", "a.6 span 0.5 – 1.5")
    assert app.store.span == (0.5, 1.5)
    use(app, "Playback command", "a.7 span all")
    assert app.store.span[1] > 1.5
    use(app, "Playback command", "a.8 toggle")
    assert app.store.clock.playing and playback_buttons(app).options[0] == "Pause"


def words(app: Application, robot: str) -> str:
    """The label under a robot, on one line."""
    return " ".join(app.display.scene._labels[robot].text.split())


def test_the_factor_is_always_written_in_the_scene(app: Application) -> None:
    """Before the stiffness is determined there is no deflection to draw, and that is said instead."""
    use(app, "Deflection ×", 77)
    assert "deflection not drawn: K is not determined" in words(app, "measured")
    assert "not identified yet" in words(app, "identified")
    use(app, "Run")
    wait(app)
    until(app, lambda: "deflection ×77" in words(app, "measured"))


def test_another_set_opens_and_a_broken_one_says_why(app: Application, folder: Path) -> None:
    assert "other" in sets_beside(folder) and "planar-2r-demo" in sets_beside(folder)
    broken = folder.parent / "broken"
    write_small_set(broken)
    (broken / "a.csv").write_text("time,theta_joint1\n0,1\n")
    use(app, "Measurement set", "other")
    until(app, lambda: app.store.measurements.name == "other")
    assert control(app, "Measurement set").value == "other"
    use(app, "Measurement set", "broken")
    until(app, lambda: "bad" in status(app))
    assert "a.csv" in status(app) and app.store.measurements.name == "other"
    use(app, "Measurement set", "small")
    until(app, lambda: app.store.measurements.name == "small")


def test_a_mistake_is_shown_and_the_app_goes_on(app: Application, capsys: Any) -> None:
    app.queue.call(lambda role: step(app, DataStep)._use("g1", role), "no such role")
    act(app)
    assert "bad" in status(app) and "no such role" in status(app)
    app.queue.call(lambda value: 1 / value, 0)
    act(app)
    assert "bad" in status(app) and "ZeroDivisionError" in status(app)
    app.store.go("Data")
    assert "Step Data" in status(app)


def every_disabled_control_says_why(app: Application, least: int) -> None:
    handles = app.page.gui._gui_input_handle_from_uuid.values()
    disabled = {handle.label: str(handle.hint) for handle in handles if getattr(handle, "disabled", False)}
    assert len(disabled) >= least
    assert not {name: hint for name, hint in disabled.items() if not re.match(r"off: \w+ .*\w", hint)}


def test_disabled_controls_say_why(app: Application) -> None:
    reopen(app, sessions_dir() / DEMO)
    every_disabled_control_says_why(app, least=5)  # Undo, Redo, Stop, Report, Animation


def test_run_stop_table_and_the_models_own_motion(app: Application) -> None:
    reopen(app, sessions_dir() / DEMO)
    use(app, "Run")
    assert app.store.runs(Identify) and off(app, "Run") and not off(app, "Stop")
    every_disabled_control_says_why(app, least=6)
    frames = app.display.playback.frames
    app.store.clock.play()
    until(app, lambda: app.display.playback.frames > frames + 3)  # playback goes on meanwhile
    wait(app)
    result = app.store.analysis.identification
    assert result is not None and app.store.analysis.up_to_date
    until(app, lambda: "validation error" in status(app))
    assert "Nm/rad" in shown(app, "fv-table")
    assert len(chart(app, "convergence", "cost")[0]) >= 2
    assert "residual" in app.plots._signals._charts
    until(app, lambda: app.store.motion.model_theta is not None)
    assert "error ×" in app.display.scene._labels["identified"].text
    app.store.undo()
    assert app.store.analysis.identification is None and "no model yet" in status(app)
    app.store.redo()
    assert app.store.analysis.identification is result
    use(app, "Run")
    use(app, "Stop")
    wait(app)
    assert not off(app, "Run")


def test_every_effect_that_can_be_named_has_a_checkbox_and_a_hint(app: Application, folder: Path) -> None:
    reopen(app, folder)
    boxes = step(app, IdentifyStep).effects.boxes
    assert set(boxes) == {*EFFECTS, *SERVO_ONLY} - {"external_contact"} and set(COMMON_EFFECTS) < set(boxes)
    assert all(name in box.hint for name, box in boxes.items())
    assert boxes["payload_error"].disabled == (
        not any(group.bodies for group in app.store.measurements.groups)
    )
    assert "stays in" in boxes["coulomb_friction"].hint
    use(app, "Presliding hysteresis", True)
    assert "replaces Coulomb friction" in shown(app)
    assert boxes["presliding_hysteresis"].value
    app.store.undo()


@pytest.mark.slow
def test_the_sweep_marks_its_minimum_and_can_be_stopped(app: Application) -> None:
    reopen(app, sessions_dir() / DEMO)
    sweep = step(app, ObserverStep).sweep
    assert not sweep._folder.visible and not sweep._best.visible
    use(app, "Sweep bandwidth")
    assert app.store.runs(Sweep) and not off(app, "Stop") and sweep._start.disabled
    wait(app)
    result = sweep._result
    assert result is not None
    assert len(result.bandwidths) == SWEEP_COUNT and "swept 11" in status(app)
    x, fit, validation, mark = sweep._charts._charts["residual"]._handle.data
    assert np.isfinite(fit).all() and x[mark.argmax()] == x[validation.argmin()]
    assert f"{result.best:.1f}"[:3] in sweep._about.content
    use(app, "Use the sweep's minimum")
    assert app.store.analysis.fit.bandwidth == pytest.approx(result.best, rel=1e-3)
    use(app, "Torque offset", True)
    assert "have changed" in sweep._about.content
    app.store.undo()
    assert "have changed" not in sweep._about.content
    use(app, "Sweep bandwidth")
    until(app, lambda: "1 of 11" in status(app))
    command(app, "Stop what is running")
    wait(app)
    assert sweep._result is not None and 1 <= len(sweep._result.bandwidths) < SWEEP_COUNT
    for row in step(app, DataStep)._roles.values():
        send(app, row, "Ignore")
    assert "No group is set to Fit" in sweep._about.content


@pytest.mark.skipif(not KUKA.is_dir(), reason="the real recording is not here")
def test_a_real_set_opens(app: Application) -> None:
    reopen(app, KUKA)
    assert "no model yet" in status(app)


def test_the_check_names_weak_parameters_and_renews_itself(app: Application, folder: Path) -> None:
    reopen(app, folder)
    use(app, "Check")
    until(app, lambda: "Checked with" in shown(app, "Checked with"))
    assert shown(app, "Checked with").count("Checked with") == 2  # in two steps
    assert app.store.analysis.identification is None and off(app, "Undo")
    send(app, step(app, DataStep)._roles["g2"], "Ignore")
    until(app, lambda: step(app, IdentifyStep).check._of == app.store.analysis.settings)
    app.store.undo()


def test_a_bandwidth_for_one_joint(app: Application, folder: Path) -> None:
    reopen(app, folder)
    use(app, "Only this joint", True)
    use(app, "Joint", "joint2")
    use(app, "exactly", 70.0)
    width = app.store.analysis.fit.bandwidth
    assert isinstance(width, tuple) and width[1] == 70.0 and width[0] != 70.0
    assert "Per joint" in shown(app)
    use(app, "Only this joint", False)
    use(app, "exactly", 80.0)
    assert app.store.analysis.fit.bandwidth == 80.0


def test_arcs_and_sides(app: Application) -> None:
    arcs = app.display.scene.measured._arcs
    until(app, lambda: len(arcs) == 4)  # torque and deflection of both joints
    use(app, "Arcs", False)
    app.store.clock.step(0.1)
    until(app, lambda: not arcs)
    use(app, "Arcs", True)
    use(app, "Loop", False)
    assert not app.store.clock.loop
    use(app, "Loop", True)


def test_a_range_marks_time_and_path(app: Application) -> None:
    reopen(app, sessions_dir() / DEMO)
    use(app, "Run")
    wait(app)
    where = app.plots.residuals
    use(app, "Highlight", "velocity")
    assert where._range.visible and app.display.scene.measured._marked is not None  # type: ignore[union-attr]
    assert {bool(value) for value in where.charts._charts["time"]._handle.data[4]} == {False, True}
    use(app, "Highlight", "nothing")
    assert app.display.scene.measured._marked is None and not where._range.visible  # type: ignore[union-attr]
