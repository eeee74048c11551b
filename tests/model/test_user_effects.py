"""User-defined effects: the example everywhere an effect appears, and a file's mistakes in one line."""

from __future__ import annotations

import json
import queue
import textwrap
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexviz.analysis.diagnosis.candidates import candidates
from flexviz.base.errors import InputError
from flexviz.base.jobs import JobEvent, Task, Worker
from flexviz.base.progress import ProgressCallback, StopCallback
from flexviz.content.session import Session, open_session, save_session
from flexviz.content.view.effects import addable_effects, more_effects
from flexviz.data.measurements import read_set
from flexviz.model.effects import (
    EFFECT_NAMES,
    EFFECTS,
    forget_effects,
    known_names,
    load_effects,
    loaded_files,
)
from flexviz.model.equation import Layout
from flexviz.model.simulation import replay, simulate_preset, simulated_effects
from flexviz.model.simulation.effect_laws import LAWS
from flexviz.outlets.terminal import main
from flexviz.robot.model import EffectValue
from tests.planar_arm import HELD_OUT, planar_set

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "user_effects.py"
PAGE = ROOT / "docs" / "user-effects.md"
NAMES = ("worm_gear_friction", "cubic_friction")
GOOD = """\
import numpy as np
from flexviz.model.effects import LinearEffect, ParameterSpec


class Mine(LinearEffect):
    name = "my_friction"
    title = "My friction"
    where = "motor"
    explanation = "Friction of mine."
    equation = "u = f v"
    signature = "A line."
    confirm = "Motion."
    reference = "Myself, 2020"
    parameters = (ParameterSpec("size", "Nm", lower=0.0),)

    def columns(self, motion):
        return motion.velocity[np.newaxis]
"""


@pytest.fixture(autouse=True)
def library() -> Iterator[None]:
    """Only the library before and after each test."""
    forget_effects()
    yield
    forget_effects()
    assert tuple(EFFECTS) == EFFECT_NAMES == tuple(LAWS) == known_names() and not loaded_files()


@pytest.fixture(scope="module")
def hidden(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A set with the example's first effect hidden on joint 2."""
    folder = tmp_path_factory.mktemp("own") / "set"
    load_effects(EXAMPLE)
    planar_set(folder, ["worm_gear_friction:joint2:forward=5"], seed=2, groups=HELD_OUT)
    forget_effects()
    return folder


def file_with(folder: Path, text: str) -> Path:
    path = folder / "mine.py"
    path.write_text(text, encoding="utf-8")
    return path


def test_example_appears_everywhere(hidden: Path) -> None:
    effects = load_effects(EXAMPLE)
    assert tuple(e.name for e in effects) == NAMES == known_names()[-2:] and loaded_files() == (EXAMPLE,)
    assert load_effects(str(EXAMPLE)) == effects and len(EFFECTS) == len(EFFECT_NAMES) + 2
    assert set(NAMES) <= set(simulated_effects()) and set(NAMES) <= set(addable_effects()) <= set(EFFECTS)
    assert set(NAMES) <= {name for names in more_effects().values() for name in names}
    measurements = read_set(hidden)
    tried = candidates(Layout(measurements.joints), measurements.groups)
    assert [c.text(measurements.joints) for c in tried if c.effect in NAMES] == [
        f"{name}:{joint}" for name in NAMES for joint in measurements.joints
    ]


def test_hidden_by_the_simulator_and_identified(hidden: Path, tmp_path: Path) -> None:
    truth = json.loads((hidden / "truth.json").read_text(encoding="utf-8"))["effects"]
    assert [(e["effect"], e["joint"]) for e in truth] == [("worm_gear_friction", "joint2")]
    assert truth[0]["parameters"] == {
        "forward": {"value": 5.0, "unit": "Nm"},
        "backward": {"value": 2.5, "unit": "Nm"},
    }
    out = tmp_path / "result.json"
    wanted = ["--effect", "worm_gear_friction:joint2", "--effects-from", str(EXAMPLE)]
    assert main(["identify", str(hidden), *wanted, "--refine", "--json", str(out)]) == 0
    found = {p["name"]: p for p in json.loads(out.read_text(encoding="utf-8"))["parameters"]}
    for name, value in (("forward", 5.0), ("backward", 2.5)):
        one = found[f"worm_gear_friction.{name}"]
        assert one["joint"] == "joint2" and one["unit"] == "Nm"
        assert one["value"] == pytest.approx(value, rel=2e-3)


@pytest.mark.slow
def test_diagnosis_finds_it(tmp_path: Path) -> None:
    """Friction with the cube of the speed."""
    load_effects(EXAMPLE)
    folder, out = tmp_path / "set", tmp_path / "diagnosis.json"
    measurements = planar_set(folder, ["cubic_friction:joint2:cubic=1"], seed=2, groups=HELD_OUT)
    forget_effects()
    options = ["--apply", "--effects-from", str(EXAMPLE), "--json", str(out)]
    assert main(["diagnose", str(folder), *options]) == 0
    found = json.loads(out.read_text(encoding="utf-8"))
    assert found["verdict"] == "missing" and found["steps"][-1]["verdict"] == "nothing-missing"
    (first,) = found["candidates"]
    assert (first["effect"], first["joint"]) == ("cubic_friction", "joint2")
    assert first["parameters"]["cubic"]["value"] == pytest.approx(1.0, rel=2e-3)
    torque = np.concatenate([group.joined("tau") for group in measurements.groups])
    assert found["torque"]["joints"] == list(measurements.joints)
    assert found["torque"]["spread"] == pytest.approx(torque.std(axis=0))


def test_diagnosis_explains_the_worm_gear(hidden: Path, tmp_path: Path) -> None:
    out = tmp_path / "diagnosis.json"
    options = ["--apply", "--effects-from", str(EXAMPLE), "--json", str(out)]
    assert main(["diagnose", str(hidden), *options]) == 0
    found = json.loads(out.read_text(encoding="utf-8"))
    assert found["verdict"] == "missing" and found["steps"][-1]["verdict"] == "nothing-missing"
    own = {
        e["effect"]: {k: v["value"] for k, v in e["parameters"].items()} for e in found["model"]["effects"]
    }
    worm = own.get("worm_gear_friction")
    if worm is None:  # the same torque: its mean, and half of its step
        coulomb, offset = own["coulomb_friction"]["coulomb"], own["torque_offset"]["offset"]
        worm = {"forward": coulomb + offset, "backward": coulomb - offset}
    assert worm == pytest.approx({"forward": 5.0, "backward": 2.5}, rel=2e-3)
    assert {e["joint"] for e in found["model"]["effects"]} == {"joint2"}


@pytest.mark.parametrize("command", ["identify", "diagnose", "serve", "record", "simulate", "effects"])
def test_every_command_has_the_option(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command, "--help"]) == 0
    words = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "--effects-from FILE" in words and "only files you trust" in words


def test_command_lists_and_shows_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["effects", "--effects-from", str(EXAMPLE)]) == 0
    assert all(name in capsys.readouterr().out for name in ("cubic_friction",))
    assert main(["effects", "cubic_friction", "--effects-from", str(EXAMPLE)]) == 0
    assert "f_3: cubic [Nm s³/rad³], ≥ 0: friction at 1 rad/s" in " ".join(capsys.readouterr().out.split())


class KnownNames(Task[tuple[str, ...]]):
    """The effects' names in the worker's process."""

    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> tuple[str, ...]:
        from flexviz.model.effects import known_names

        return known_names()


def result_of(worker: Worker) -> JobEvent:
    events: queue.Queue[JobEvent] = queue.Queue()
    worker.submit(KnownNames(), events.put)
    while True:
        event = events.get(timeout=60)
        if event.kind not in ("started", "progress"):
            return event


def test_worker_processes_load_it_too(tmp_path: Path) -> None:
    worker = Worker()
    try:
        load_effects(EXAMPLE)
        assert result_of(worker).value[-2:] == NAMES
        other = file_with(tmp_path, GOOD)
        load_effects(other)  # while the process runs
        assert result_of(worker).value[-3:] == (*NAMES, "my_friction")
    finally:
        worker.close()
    worker = Worker()
    try:
        other.write_text("raise RuntimeError('gone bad')\n", encoding="utf-8")
        failed = result_of(worker)
        assert failed.kind == "failed" and "line 1: RuntimeError: gone bad" in failed.value
    finally:
        worker.close()


def test_sessions_keep_its_name_and_never_its_code(hidden: Path, tmp_path: Path) -> None:
    load_effects(EXAMPLE)
    measurements = read_set(hidden)
    session = Session.of(measurements)
    session = session.then("with it", session.analysis.with_effects(["worm_gear_friction:joint2"]))
    folder = save_session(session, measurements, tmp_path / "kept")
    assert open_session(folder).session.analysis.effects == ("worm_gear_friction:joint2",)
    forget_effects()
    with pytest.raises(InputError, match=f"worm_gear_friction:joint2 came .*--effects-from {EXAMPLE}"):
        open_session(folder)


def test_sets_may_start_with_it(hidden: Path, tmp_path: Path) -> None:
    import shutil

    folder = tmp_path / "set"
    shutil.copytree(hidden, folder)
    toml = folder / "measurements.toml"
    text = toml.read_text(encoding="utf-8")
    assert "[model]\neffects = []\n" in text
    toml.write_text(text.replace("effects = []", 'effects = ["worm_gear_friction"]'), encoding="utf-8")
    with pytest.raises(InputError, match=r"model.effects.*--effects-from"):
        read_set(folder)
    load_effects(EXAMPLE)
    assert read_set(folder).effects == ("worm_gear_friction",)


def test_replay_with_and_without_a_simulation(hidden: Path, tmp_path: Path) -> None:
    load_effects(EXAMPLE)
    load_effects(file_with(tmp_path, GOOD))
    measurements = read_set(hidden)
    from flexviz.model.simulation import PRESETS

    model = PRESETS["planar-2r"]().model
    group = measurements.groups[0]
    kept = EffectValue("worm_gear_friction", "joint2", {"forward": 5.0, "backward": 2.5})
    left_out = EffectValue("my_friction", "joint1", {"size": 1.0})
    options: dict[str, Any] = {"torque_hold": measurements.torque_hold, "duration": 1.0}
    gains = measurements.kp, measurements.kd
    both = replace(model, effects=(kept, left_out))
    run = replay(measurements.robot, both, group, *gains, **options)
    assert [fact.values.get("effect") for fact in run.facts] == [None, "my_friction"]
    alone = replay(measurements.robot, replace(model, effects=(kept,)), group, *gains, **options)
    np.testing.assert_array_equal(run.theta, alone.theta)
    nothing = replay(measurements.robot, replace(model, effects=()), group, *gains, **options)
    assert np.abs(run.tau - nothing.tau).max() > 1.0
    with pytest.raises(InputError, match=r"my_friction.*cannot be hidden"):
        simulate_preset("planar-2r", tmp_path / "out", ["my_friction:joint1"])
    with pytest.raises(InputError, match="forward is -1"):
        simulate_preset("planar-2r", tmp_path / "out", ["worm_gear_friction:joint1:forward=-1"])


COLUMNS = "    def columns"
CHANGES = {
    "syntax": ('title = "My friction"', "title = = 1", "line 7: invalid syntax"),
    "fails when run": ("import numpy as np", "import nunpy as np", "line 1: ModuleNotFoundError"),
    "missing attribute": (
        '    confirm = "Motion."\n',
        "",
        'line 5: class Mine: attribute "confirm" is missing',
    ),
    "missing method": ("def columns", "def column", 'line 5: class Mine: method "columns" is missing'),
    "taken": ('"my_friction"', '"backlash"', 'line 6: class Mine: name "backlash" is taken'),
    "not snake_case": ('"my_friction"', '"My friction"', "line 6: class Mine: .* not snake_case"),
    "where": ('"motor"', '"moter"', 'line 8: class Mine: where "moter": did you mean "motor"'),
    "empty text": ('"A line."', '""', "line 11: class Mine: signature is ''"),
    "parameters": ('(ParameterSpec("size", "Nm", lower=0.0),)', "()", "line 14: .* tuple of ParameterSpec"),
    "bounds": ("lower=0.0", "lower=2.0, upper=1.0", "line 14: .* leave no room"),
    "replaces": (COLUMNS, f'    replaces = "x"\n\n{COLUMNS}', 'line 16: class Mine: replaces "x"'),
    "example": (COLUMNS, f"    example = (-1.0,)\n\n{COLUMNS}", "line 16: .* out of its bounds"),
    "scope": (COLUMNS, f'    scope = "episode"\n\n{COLUMNS}', 'line 16: .* scope "episode"'),
    "shape": ("[np.newaxis]", "", r"line 16: .* shape \(3001,\), expected \(1, 3001\)"),
    "raises": ("motion.velocity[", "motion.speed[", "line 17: .* AttributeError"),
    "not finite": ("motion.velocity[", "np.log(motion.velocity)[", "line 16: .* not finite"),
    "state": ("motion.velocity[", "motion.torque[", "line 16: .* state = True is missing"),
    "state by stiffness": ("motion.velocity[", "motion.stiffness * motion.time[", "state = True is missing"),
    "state by friction": (
        "motion.velocity[",
        "motion.motor_viscous * motion.time[",
        "state = True is missing",
    ),
    "state by the link": ("motion.velocity[", "motion.link_position[", "line 16: .* state = True is missing"),
    "no parameters": (
        "parameters = (ParameterSpec",
        "parameters = 0, (ParameterSpec",
        "line 14: .* tuple of",
    ),
    "parameter's name": ('("size",', '("Size",', 'line 14: .* "Size" is not a unique snake_case name'),
    "parameter twice": (
        "lower=0.0),)",
        'lower=0.0), ParameterSpec("size", "Nm"))',
        'line 14: .* "size" is not a unique',
    ),
    "no room": ("lower=0.0", "lower=1.0, upper=1.0", "line 14: .* leave no room"),
    "examples": (COLUMNS, f"    example = (1.0, 2.0)\n\n{COLUMNS}", "line 16: .* has 2 values, expected 1"),
    "endless example": (
        COLUMNS,
        f"    example = (float('inf'),)\n\n{COLUMNS}",
        "line 16: .* size = inf is out",
    ),
    "grid": (COLUMNS, f"    grid = {{'sice': (1.0,)}}\n\n{COLUMNS}", 'line 16: .* grid "sice": did you mean'),
    "set": (COLUMNS, f'    scope = "set"\n\n{COLUMNS}', 'line 16: .* scope is "set", expected "joint"'),
    "no constructor": (
        COLUMNS,
        f"    def __init__(self):\n        1 / 0\n\n{COLUMNS}",
        "line 17: .*ZeroDivision",
    ),
    "guesses": (
        COLUMNS,
        f"    def guesses(self, context, place):\n        return [1]\n\n{COLUMNS}",
        "line 16: .* guesses raises AttributeError",
    ),
    "not a number": ('title = "My friction"', "title = 3", "line 7: .* title is 3, expected a text"),
}


@pytest.mark.parametrize("what", CHANGES)
def test_errors_name_file_and_line(what: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    old, new, message = CHANGES[what]
    assert old in GOOD
    path = file_with(tmp_path, GOOD.replace(old, new, 1))
    with pytest.raises(InputError, match=message) as caught:
        load_effects(path)
    assert caught.value.file == str(path) and "\n" not in str(caught.value)
    assert main(["effects", "--effects-from", str(path)]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 and lines[0].startswith(f"flexviz: {path}, line ")


LAW = GOOD.replace("LinearEffect", "LawEffect").replace(
    "    def columns(self, motion):\n        return motion.velocity[np.newaxis]\n",
    """\
    def law(self, motion, values):
        u = values[0] * motion.velocity
        return u, SLOPES

    def simulation(self, values):
        return lambda at: SIGN * values[0] * at.theta_velocity
""",
)


@pytest.mark.parametrize(
    ("slopes", "sign", "message"),
    [
        ("motion.velocity[np.newaxis]", "", None),
        ("1.01 * motion.velocity[np.newaxis]", "", "line 16: .*∂u/∂size differs from .* by 0.99 %"),
        ("motion.velocity", "", "line 16: .*slopes has shape"),
        ("1.0005 * motion.velocity[np.newaxis]", "", None),
        ("-motion.velocity[np.newaxis]", "", "line 16: .*∂u/∂size differs"),
        ("motion.velocity[np.newaxis]", "-", "line 20: .* simulation and u differ by 2e.02 %"),
        ("motion.velocity[np.newaxis]", "1.002 * ", "line 20: .* simulation and u differ by 0.2 %"),
    ],
)
def test_derivatives_and_simulation_are_checked(
    slopes: str, sign: str, message: str | None, tmp_path: Path
) -> None:
    path = file_with(tmp_path, LAW.replace("SLOPES", slopes).replace("SIGN * ", f"{sign}1.0 * "))
    if message is None:
        assert load_effects(path)[0].name == "my_friction" and "my_friction" in simulated_effects()
        return
    with pytest.raises(InputError, match=message):
        load_effects(path)
    assert "my_friction" not in EFFECTS


def test_files_that_are_none(tmp_path: Path) -> None:
    for path, message in (
        (tmp_path / "none.py", "does not exist"),
        (tmp_path, "is not a file"),
        (file_with(tmp_path, "x = 1\n"), "defines no effect"),
    ):
        with pytest.raises(InputError, match=message):
            load_effects(path)
    text = tmp_path / "effects.txt"
    text.write_text(GOOD, encoding="utf-8")
    with pytest.raises(InputError, match=r"end in \.py"):
        load_effects(text)
    twice = GOOD + GOOD[GOOD.index("class") :].replace("Mine", "Other")
    with pytest.raises(InputError, match='two effects are called "my_friction"'):
        load_effects(file_with(tmp_path, twice))


def test_page_shows_the_example() -> None:
    page, code = PAGE.read_text(encoding="utf-8"), EXAMPLE.read_text(encoding="utf-8")
    shown = page.split("```python\n")[1].split("```")[0]
    inside = shown[shown.index("class ") :].strip()
    assert inside in code or textwrap.dedent(inside) in code
