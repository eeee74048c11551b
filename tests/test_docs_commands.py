"""Every command that a document shows exists with these options and runs; so does its Python.

They run in this process on a short record of the demonstration's robot. Of two long ones the work itself is
left out: the search for what is missing is made once, and presets are simulated for a second or two. What a
person ends (the app, a viewer) is not begun, its arguments are looked at.
"""

from __future__ import annotations

import importlib.util
import re
import runpy
import shutil
from dataclasses import replace
from operator import attrgetter
from pathlib import Path
from typing import Any

import pytest
import typer

import flexviz.analysis.diagnosis
import flexviz.batch
import flexviz.model.simulation
import flexviz.model.simulation.sets as sets
import flexviz.outlets.batch.study
import flexviz.outlets.terminal
import flexviz.simulation
from flexviz.analysis.diagnosis import diagnose
from flexviz.content.session import Session, save_session
from flexviz.data.measurements import read_set
from flexviz.model.effects import forget_effects
from flexviz.outlets.batch import study_runs
from tests.cases import with_slow
from tests.shown_commands import PAGES, ROOT, Shown, blocks, mentions

LENGTH = 4.0  # [s] of a simulated motion that is identified afterwards
GLIMPSE = 0.3  # [s] of one that is not
SHOWN = {page: commands for page in PAGES if (commands := blocks(page))}
LONG = "designing", "recording", "fleets", "simulator"  # pages
stem = attrgetter("stem")
WITH_PYTHON = [page for page in PAGES if "```python" in page.read_text(encoding="utf-8")]
SETS = ("SET", "my_set", "my_recording", "demo", "sessions/planar-2r-demo")  # what stands for a set
SESSIONS = ("SESSION",)
OWN = "examples/user_effects.py"
PLACES = {"FILE": "written.json", "DIR": "folder", "FILE.rrd": "written.rrd"}
# where `diagnose` is replaced: the package last, for the others take it from there when they are imported
DIAGNOSING = (
    "flexviz.outlets.workflows",
    "flexviz.outlets.batch.analysis",
    "flexviz.outlets.batch.study_runs",
    "flexviz",
    "flexviz.analysis.diagnosis",
)
make_plan = sets.make_plan


def short_plan(*arguments: Any, **named: Any) -> Any:
    """The plan with one group to fit and one held out, both short."""
    plan = make_plan(*arguments, **named)
    length = GLIMPSE if plan.robot.n > 2 or "paper" in plan.name else LENGTH
    groups = [*(g for g in plan.groups if not g.validation)][:1] + [g for g in plan.groups if g.validation]
    return replace(plan, groups=tuple(replace(g, duration=min(g.duration, length)) for g in groups))


@pytest.fixture(scope="module")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A short set, what a diagnosis of it gives, and a session of both."""
    folder = tmp_path_factory.mktemp("docs")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sets, "make_plan", short_plan)
        sets.simulate_preset("planar-2r", folder / "set", ["coulomb_friction:joint2:coulomb=3"], 1)
    measurements = read_set(folder / "set")
    found = diagnose(measurements, apply=True)
    assert found.verdict == "missing"
    session = Session.of(measurements)
    result = flexviz.identify(measurements)
    analysis = session.analysis.with_identification(result, session.analysis.settings)
    save_session(session.then("identified", analysis.with_diagnosis(found)), measurements, folder / "kept")
    return folder, found


@pytest.fixture
def workplace(tiny: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A folder with everything that the documents take for granted; long work made short."""
    folder, found = tiny
    for name in SETS:
        shutil.copytree(folder / "set", tmp_path / name)
    shutil.copytree(folder / "set", tmp_path / "fleet" / "robot-1" / "run1")
    for name in SESSIONS:
        shutil.copytree(folder / "kept", tmp_path / name)
    (tmp_path / "examples").mkdir()
    shutil.copy(ROOT / OWN, tmp_path / OWN)
    renamed = (ROOT / OWN).read_text(encoding="utf-8").replace('name = "', 'name = "my_')
    (tmp_path / "my_effects.py").write_text(renamed, encoding="utf-8")
    shutil.copy(ROOT / "robots" / "planar_2r" / "planar_2r.urdf", tmp_path / "my_robot.urdf")
    measurements = read_set(folder / "set")
    for number, group in enumerate(measurements.groups[:2], 1):
        table = group.segments[0]
        columns = [table.time, *table.theta.T, *table.tau.T]
        head = ["time", *(f"{s}_{j}" for s in ("theta", "tau") for j in measurements.joints)]
        lines = [",".join(head), *(",".join(f"{x:.9g}" for x in row) for row in zip(*columns, strict=True))]
        (tmp_path / f"run{number}.csv").write_text("\n".join(lines) + "\n")
    monkeypatch.chdir(tmp_path)
    for module in (sets, flexviz.model.simulation, flexviz.simulation, study_runs):
        monkeypatch.setattr(module, "make_plan", short_plan)
    monkeypatch.setattr("flexviz.analysis.designing.search.GroupSearch.improve", lambda *arguments: None)
    (tmp_path / "LIMITS.toml").write_text("[default]\nheld_out_percent = 50.0\n")
    (tmp_path / "FILE.toml").write_text("groups = 1\nduration = 5.0\n")

    def known(measurements: Any, **options: Any) -> Any:
        assert not options.keys() - {
            "apply",
            "guard",
            "free_curve",
            "progress",
            "should_stop",
            "start",
            "decoys",
        }
        return replace(found, set_name=measurements.name)

    for place in DIAGNOSING:
        monkeypatch.setattr(f"{place}.diagnose", known)
    runs = flexviz.outlets.batch.study.study_tasks
    monkeypatch.setattr(flexviz.outlets.batch.study, "study_tasks", lambda plan: list(runs(plan))[-1:])
    here = flexviz.outlets.batch.ClusterChoice(1, processes=False)
    for module in (flexviz.outlets.batch, flexviz.batch):
        monkeypatch.setattr(module, "ClusterChoice", lambda *given, **named: here)
    served: list[Path | None] = []

    def serve(source: Path | None, *, host: str, port: int | None, open_browser: bool, **_: Any) -> None:
        assert source is None or source.is_dir()
        served.append(source)

    monkeypatch.setattr("flexviz.outlets.app.serve", serve)
    monkeypatch.setattr(
        "flexviz.outlets.terminal.viewing.show", lambda files, *options: [file.stat() for file in files]
    )
    monkeypatch.setattr("flexviz.outlets.recording.writing.RecordingFile.simulate", lambda *arguments: None)
    study_runs._motion.cache_clear()
    yield tmp_path
    study_runs._motion.cache_clear()
    forget_effects()


@pytest.mark.parametrize("page", with_slow(SHOWN, LONG, stem), ids=stem)
def test_shown_commands_run(page: Path, workplace: Path, capfd: pytest.CaptureFixture[str]) -> None:
    for shown in SHOWN[page]:
        program, *words = shown.words
        if program == "flexviz":
            for place in ("before.rrd", "after.rrd"):
                if place in words:
                    shutil.copy("demo.rrd", place)
            arguments = [PLACES.get(word, word) for word in words if word != "…"]
            if "--out" in arguments:
                out = Path(arguments[arguments.index("--out") + 1])
                shutil.rmtree(out, ignore_errors=True)  # a page may show several ways to the same place
            code = flexviz.outlets.terminal.main(arguments)
            assert code == 0, f"{shown}: {capfd.readouterr().err}"
        else:
            look_at(program, words, shown)


@pytest.mark.parametrize("page", WITH_PYTHON, ids=stem)
def test_shown_python_runs(page: Path, workplace: Path) -> None:
    shown = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    Path("page.py").write_text("\n".join(shown), encoding="utf-8")
    runpy.run_path("page.py", run_name="__main__")


def look_at(program: str, words: list[str], shown: Shown) -> None:
    """A command of the project's own household: what it names is there."""
    if program == "make":
        targets = re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
        assert words[0] in targets, shown
    elif program == "python" and words[0].startswith("examples/"):
        assert (ROOT / words[0]).is_file(), shown  # test_examples runs them
    elif program == "python" and words[0] == "-m" and words[1].startswith("benchmarks"):
        assert importlib.util.find_spec(words[1]) is not None, shown
    else:
        raise AssertionError(f"{shown}: nobody has said how this is tested")


# -- that they exist ---------------------------------------------------------------------------------

MENTIONED = [shown for page in PAGES for shown in (*mentions(page), *SHOWN.get(page, ()))]
COMMANDS: Any = typer.main.get_command(flexviz.outlets.terminal.app)


def test_mentioned_commands_exist_with_their_options() -> None:
    wrong = []
    for shown in MENTIONED:
        program, *words = shown.words
        if program != "flexviz" or not words or words[0].startswith("-"):
            continue
        command = COMMANDS.commands.get(words[0])
        if command is None:
            wrong.append(f"{shown}: there is no such command")
            continue
        known = {name for p in command.params for name in (*p.opts, *p.secondary_opts)} | {"--help"}
        wrong += [
            f"{shown}: {command.name} has no {option}"
            for option in re.findall(r"(?<!\S)\[?(--[a-z-]+)", " ".join(words[1:]))
            if option not in known
        ]
    assert not wrong
    assert len(MENTIONED) > 80


def test_every_command_stands_in_the_readme() -> None:
    named = {shown.words[1] for shown in mentions(ROOT / "README.md") if len(shown.words) > 1}
    assert not set(COMMANDS.commands) - named
