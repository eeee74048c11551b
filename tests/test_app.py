"""The whole application without a browser: events in, what is on the screen out."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexviz.app import DEMO
from flexviz.app.application import Application
from flexviz.app.keys import COMMANDS
from flexviz.app.work import open_set, sets_beside
from flexviz.effects import EFFECTS
from flexviz.resources import sessions_dir
from flexviz.view.effects import COMMON_EFFECTS
from flexviz.view.sweep import COUNT
from tests.app_running import running
from tests.small_set import write_small_set

KUKA = Path(__file__).resolve().parents[2] / "shared" / "real" / "kuka_kr300"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("app")
    write_small_set(root / "other")
    return write_small_set(root / "small")


@pytest.fixture(scope="module")
def app(folder: Path) -> Iterator[Application]:
    with running(folder.parent, folder) as application:
        yield application


def act(app: Application, key: str, value: Any = None) -> None:
    """An event, and the loop until it has acted."""
    app.queue.put(key, value, each=True)
    while len(app.queue):
        app.once(0.0)
    app.once(0.0)


def until(app: Application, condition: Callable[[], bool], timeout: float = 300.0) -> None:
    deadline = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < deadline, f"waited in vain; status: {status(app)}"
        app.once(0.05)


def pass_time(app: Application, seconds: float) -> None:
    end = time.monotonic() + seconds
    until(app, lambda: time.monotonic() >= end, timeout=seconds + 60.0)


def status(app: Application) -> str:
    return app.dock._status.content


def chart(app: Application, column: str, key: str) -> tuple[np.ndarray, ...]:
    return getattr(app.show.plots, f"_{column}")._charts[key]._handle.data


def test_starts_playing_and_says_where_one_is(app: Application) -> None:
    assert app.show.clock.playing
    assert "Step Data" in status(app) and "no model yet" in status(app)
    frames = app.show.playback.frames
    until(app, lambda: app.show.playback.frames > frames + 5)
    for column in (chart(app, "signals", "torque"), chart(app, "states", "theta4")):
        assert all(np.isfinite(values).all() and len(values) <= 600 for values in column)


def test_bandwidth_redraws_the_states(app: Application) -> None:
    before = chart(app, "states", "theta3")[1]
    act(app, "bandwidth-log", np.log10(120.0))
    after = chart(app, "states", "theta3")[1]
    assert len(before) != len(after) or not np.array_equal(before, after)
    assert app.session.analysis.bandwidth == pytest.approx(120.0, rel=1e-3)
    assert "120" in app.observer._numbers.content
    act(app, "observer", "eso")
    assert "disturbance" in app.show.plots._states._charts
    act(app, "bandwidth-default")
    assert app.session.analysis.bandwidth is None
    for _ in range(3):
        app.undo()
    assert app.session.analysis.observer == "butterworth-zero-phase"


def test_joint_and_group_are_selected_everywhere(app: Application) -> None:
    torque = chart(app, "signals", "torque")[1]
    act(app, "joint", "joint2")
    assert app.show.joint == 1 and not np.array_equal(torque, chart(app, "signals", "torque")[1])
    act(app, "click", 0)
    assert app.dock._joint.value == "joint1"
    act(app, "group", "g3")
    assert app.show.group.name == "g3" and app.dock._group.value == "g3"
    act(app, "group", "g1")


def test_steps_show_their_controls(app: Application) -> None:
    for step in ("Observer", "Identify", "Diagnose", "Data"):
        act(app, "step", step)
        assert [name for name, part in app.steps.items() if part.folder.visible] == [step]
        assert f"Step {step}" in status(app)


def test_roles_and_effects_are_in_the_history(app: Application) -> None:
    act(app, "role0", "Ignore")
    act(app, "role1", "Validate")
    assert app.identify._run.disabled and "No group" in app.data._hint.content
    app.undo()
    app.undo()
    assert app.data._rows[0].value == "Fit" and not app.identify._run.disabled
    act(app, "effect-torque_offset", True)
    assert app.session.analysis.effects == ("torque_offset",)
    app.undo()
    assert not app.identify.effects.boxes["torque_offset"].value
    assert app.identify.effects.boxes["coulomb_friction"].disabled  # the set's own


def test_every_command_does_something_and_has_a_name_of_its_own(app: Application) -> None:
    assert set(app.keys._actions) == {key for key, *_ in COMMANDS}
    assert len({label for _, label, *_ in COMMANDS}) == len(COMMANDS)
    hotkeys = [(hotkey, modifier) for _, _, hotkey, modifier in COMMANDS if hotkey]
    assert len(set(hotkeys)) == len(hotkeys)
    pass_time(app, 0.3)  # a key at the same time as a control would be the control's
    for key, seen in (
        ("3", lambda: app.dock.step == "Identify"),
        ("joint", lambda: app.show.joint == 1),
        ("group", lambda: app.show.group.name == "g2"),
        ("layout", lambda: app.view.layout == "Overlaid"),
        ("best", lambda: "nothing has been swept yet" in status(app)),
        ("add", lambda: "nothing is found" in status(app)),
        ("report", lambda: "nothing was found yet" in status(app)),
    ):
        act(app, "command", (key, 0))
        until(app, seen)
    for key in ("1", "joint", "group", "group", "layout"):
        act(app, "command", (key, 0))
    until(app, lambda: app.view.layout == "Side by side" and app.show.group.name == "g1")


def test_playback_controls(app: Application) -> None:
    act(app, "playback", "Pause")
    act(app, "time", 1.5)
    assert app.show.clock.time == pytest.approx(1.5)
    act(app, "playback", "Step ▶")
    assert app.show.clock.time == pytest.approx(1.5 + 1 / 30)
    pass_time(app, 0.2)
    act(app, "command", ("toggle", 0))
    until(app, lambda: app.show.clock.playing)
    act(app, "speed", "2×")
    act(app, "layout", "Overlaid")
    act(app, "layout", "Side by side")
    frames = app.show.playback.frames
    pass_time(app, 1.0)
    assert app.show.playback.frames - frames > 15


def test_a_key_that_a_focused_slider_takes_does_not_step(app: Application) -> None:
    act(app, "playback", "Pause")
    act(app, "time", 1.0)
    app.queue.put("command", ("forward", 0), each=True)
    app.queue.put("deflection", 5)
    pass_time(app, 0.3)
    assert app.show.clock.time == pytest.approx(1.0)
    act(app, "command", ("forward", 0))
    pass_time(app, 0.3)
    assert app.show.clock.time == pytest.approx(1.0 + 1 / 30)


def test_the_factor_is_always_written_in_the_scene(app: Application) -> None:
    app.view._deflection.value = 77
    act(app, "deflection", 77)
    assert "deflection ×77" in app.show.scene._labels["measured"].text
    assert "not identified yet" in app.show.scene._labels["identified"].text


def test_another_set_opens_and_a_broken_one_says_why(app: Application, folder: Path) -> None:
    assert "other" in sets_beside(folder) and "planar-2r-demo" in sets_beside(folder)
    broken = folder.parent / "broken"
    write_small_set(broken)
    (broken / "a.csv").write_text("time,theta_joint1\n0,1\n")
    act(app, "set", "other")
    until(app, lambda: app.measurements.name == "other")
    assert app.data._choice.value == "other"
    act(app, "set", "broken")
    until(app, lambda: "bad" in status(app))
    assert "a.csv" in status(app) and app.measurements.name == "other"
    act(app, "set", "small")
    until(app, lambda: app.measurements.name == "small")


def test_a_mistake_is_shown_and_the_app_goes_on(app: Application, capsys: Any) -> None:
    act(app, "role0", "no such role")
    assert "bad" in status(app)
    act(app, "no such event")
    act(app, "step", "Data")
    assert app.dock.step == "Data"


@pytest.mark.slow
def test_run_stop_table_and_the_models_own_motion(app: Application) -> None:
    app.open(open_set(sessions_dir() / DEMO))
    act(app, "run")
    assert app.identify.running and app.identify._run.disabled and not app.dock._stop.disabled
    frames, begin = app.show.playback.frames, time.monotonic()
    app.show.clock.play()
    until(app, lambda: not app.identify.running)
    rate = (app.show.playback.frames - frames) / (time.monotonic() - begin)
    result = app.session.analysis.identification
    assert result is not None and app.session.analysis.up_to_date
    assert "validation error" in status(app) and "Nm" in status(app)
    assert "Nm/rad" in app.identify._table.content
    assert len(chart(app, "convergence", "cost")[0]) >= 2
    assert "residual" in app.show.plots._signals._charts
    assert rate > 10
    until(app, lambda: app.show.motion.model_theta is not None)
    assert "error ×" in app.show.scene._labels["identified"].text
    app.undo()
    assert app.session.analysis.identification is None and "no model yet" in status(app)
    app.redo()
    assert app.session.analysis.identification is result
    act(app, "run")
    act(app, "stop")
    until(app, lambda: not app.identify.running)
    assert not app.identify._run.disabled


def test_every_effect_that_can_be_named_has_a_checkbox_and_a_hint(app: Application, folder: Path) -> None:
    app.open(open_set(folder))
    boxes = app.identify.effects.boxes
    assert set(boxes) == set(EFFECTS) - {"external_contact"} and set(COMMON_EFFECTS) < set(boxes)
    assert all(EFFECTS[name].title in box.hint for name, box in boxes.items())
    assert boxes["payload_error"].disabled == (not any(group.bodies for group in app.measurements.groups))
    assert "stays in" in boxes["coulomb_friction"].hint
    act(app, "effect-presliding_hysteresis", True)
    assert "takes the place of coulomb_friction" in app.identify.effects._note.content
    assert boxes["presliding_hysteresis"].value
    app.undo()


@pytest.mark.slow
def test_the_sweep_marks_its_minimum_and_can_be_stopped(app: Application) -> None:
    app.open(open_set(sessions_dir() / DEMO))
    sweep = app.observer.sweep
    assert not sweep._folder.visible and not sweep._best.visible
    act(app, "sweep")
    assert sweep.running and not app.dock._stop.disabled and sweep._start.disabled
    until(app, lambda: not sweep.running)
    result = sweep._result
    assert len(result.bandwidths) == COUNT and "swept 11" in status(app)
    x, fit, validation, mark = sweep._charts._charts["residual"]._handle.data
    assert np.isfinite(fit).all() and x[mark.argmax()] == x[validation.argmin()]
    assert f"{result.best:.1f}"[:3] in sweep._about.content
    act(app, "sweep-best")
    assert app.session.analysis.bandwidth == pytest.approx(result.best, rel=1e-3)
    act(app, "effect-torque_offset", True)
    assert "have changed" in sweep._about.content
    app.undo()
    assert "have changed" not in sweep._about.content
    act(app, "sweep")
    until(app, lambda: "1 of 11" in status(app))
    act(app, "command", ("stop", 0))
    until(app, lambda: not sweep.running)
    assert 1 <= len(sweep._result.bandwidths) < COUNT
    for index in range(len(app.measurements.groups)):
        act(app, f"role{index}", "Ignore")
    assert "Sweep is off" in sweep._about.content


@pytest.mark.skipif(not KUKA.is_dir(), reason="the real recording is not here")
def test_a_real_set_opens(app: Application) -> None:
    app.open(open_set(KUKA))
    assert "no model yet" in status(app)


def test_the_check_names_weak_parameters_and_renews_itself(app: Application, folder: Path) -> None:
    app.open(open_set(folder))
    check = app.identify.check
    act(app, "check")
    until(app, lambda: "Checked with" in check._texts[0].content)
    assert check._texts[1].content == check._texts[0].content  # in step Data too
    assert app.session.analysis.identification is None and app.dock._undo.disabled
    act(app, "role1", "Ignore")
    until(app, lambda: check._of == app.session.analysis.settings)
    app.undo()


def test_a_bandwidth_for_one_joint(app: Application, folder: Path) -> None:
    app.open(open_set(folder))
    app.observer._single.value = True
    act(app, "joint", "joint2")
    act(app, "bandwidth", 70.0)
    width = app.session.analysis.bandwidth
    assert isinstance(width, tuple) and width[1] == 70.0 and width[0] != 70.0
    assert "One a joint" in app.observer._numbers.content
    app.observer._single.value = False
    act(app, "bandwidth", 80.0)
    assert app.session.analysis.bandwidth == 80.0


def test_torque_arrows_and_sides(app: Application) -> None:
    app.view._torque.value = True
    act(app, "torque", True)
    until(app, lambda: len(app.show.scene.measured._arrows) == 2)  # type: ignore[union-attr]
    app.view._torque.value = False
    act(app, "torque", False)
    app.show.clock.step(0.1)
    until(app, lambda: not app.show.scene.measured._arrows)  # type: ignore[union-attr]
    act(app, "loop", False)
    assert not app.show.clock.loop
    act(app, "loop", True)


def test_a_range_marks_time_and_path(app: Application) -> None:
    app.open(open_set(sessions_dir() / DEMO))
    act(app, "run")
    until(app, lambda: not app.running)
    where = app.show.plots.where
    where._variable.value = "velocity"
    act(app, "highlight", "velocity")
    assert where._range.visible and app.show.scene.measured._marked is not None  # type: ignore[union-attr]
    assert {bool(value) for value in where._charts._charts["time"]._handle.data[4]} == {False, True}
    where._variable.value = "nothing"
    act(app, "highlight", "nothing")
    assert app.show.scene.measured._marked is None and not where._range.visible  # type: ignore[union-attr]
