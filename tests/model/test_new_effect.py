"""Adding an effect by the list in CONTRIBUTING.md: five places, and everything works for it.

`made_up_effect.py` stands for the new file; the other four places are filled for the time of these tests.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from math import copysign, expm1
from pathlib import Path

import numpy as np
import pytest

from benchmarks.effect_pages.pages import page
from benchmarks.effect_pages.pictures import PICTURES, VELOCITY, Curve, Picture, draw, sweep, velocity
from flexviz.analysis.diagnosis import diagnose
from flexviz.analysis.identification import identify
from flexviz.content.view import addable_effects, more_effects
from flexviz.data.measurements import read_set
from flexviz.model.effects import EFFECT_NAMES, EFFECTS, EffectTarget, LawEffect
from flexviz.model.effects.registry import library
from flexviz.model.effects.trial import TrialMotion, TrialSignal
from flexviz.model.simulation import simulated_effects
from flexviz.model.simulation.effect_laws import LAWS, motor
from flexviz.model.simulation.laws import MotorLaw
from flexviz.outlets.exporting import FORMATS, LeftOut, coverage
from flexviz.outlets.exporting.coverage import REGISTRIES
from flexviz.outlets.terminal import main
from tests import made_up_effect
from tests.planar_arm import HELD_OUT, planar_set

ROOT = Path(__file__).resolve().parents[2]
NAME = "saturating_friction"
PLATEAU, SPEED = 4.0, 0.4
PLACES = (
    "flexviz/model/effects/<name>.py",
    "flexviz/model/effects/names.py",
    "flexviz/model/simulation/effect_laws.py",
    "flexviz/outlets/exporting/coverage.py",
    "benchmarks/effect_pages/pictures.py",
)
NO_LAW = LeftOut("made up for the tests")


def simulated_law(plateau: float, speed: float) -> MotorLaw:
    """f_e (1 − exp(−|θ̇|/v_e)) sign(θ̇), written without a look at the class."""
    return lambda t, theta, velocity, load: plateau * copysign(expm1(-abs(velocity) / speed), velocity)


@pytest.fixture(scope="module", autouse=True)
def registered() -> Iterator[None]:
    """The five places of the list."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, f"flexviz.model.effects.{NAME}", made_up_effect)
        patch.setattr("flexviz.model.effects.names.EFFECT_NAMES", (*EFFECT_NAMES, NAME))
        patch.setitem(EFFECTS, NAME, library((NAME,))[NAME])  # what the registry makes of both
        patch.setitem(LAWS, NAME, motor(simulated_law, positive=("speed",)))
        for entries in REGISTRIES.values():
            patch.setitem(entries, NAME, NO_LAW)
        curve = Curve(sweep(1.0), (2.0, 0.3))
        patch.setitem(PICTURES, NAME, Picture(VELOCITY, velocity, (curve,), "a sweep of the speed"))
        yield


@pytest.fixture(scope="module")
def injected(tmp_path_factory: pytest.TempPathFactory, registered: None) -> Path:
    """A simulated set with the effect on joint 2."""
    folder = tmp_path_factory.mktemp("new") / "set"
    planar_set(folder, [f"{NAME}:joint2:plateau={PLATEAU},speed={SPEED}"], seed=3, groups=HELD_OUT)
    return folder


def test_the_list_is_in_contributing() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    section = text.split("## Adding an effect")[1].split("\n## ")[0]
    assert [place for place in PLACES if f"`{place}`" in section] == list(PLACES)
    for place in PLACES[1:]:
        assert (ROOT / place).is_file()


def test_slopes_agree_with_finite_differences_and_the_law_with_the_simulator() -> None:
    effect = EFFECTS[NAME]
    assert isinstance(effect, LawEffect)
    motion = TrialMotion(np.linspace(0.1, 4.0, 500), TrialSignal(((0.6, 1.3, 0.2), (0.3, 3.1, 1.0)))).motions(
        0
    )[0]
    values = np.array([PLATEAU, SPEED])
    u, slopes = effect.law(motion, values)
    law = simulated_law(*values.tolist())
    np.testing.assert_allclose(u, [law(0.0, 0.0, v, 0.0) for v in motion.velocity.tolist()], rtol=1e-12)
    for k, slope in enumerate(slopes):
        step = np.zeros(2)
        step[k] = 1e-6
        measured = (effect.law(motion, values + step)[0] - effect.law(motion, values - step)[0]) / 2e-6
        np.testing.assert_allclose(slope, measured, rtol=1e-5, atol=1e-8)


def test_guesses_and_targets_come_with_the_base_class() -> None:
    motion = TrialMotion(np.linspace(0.0, 6.0, 301), TrialSignal(((0.6, 1.3, 0.2),)))
    guesses = EFFECTS[NAME].guesses(motion, EffectTarget(joint=0))
    assert [tuple(g.to_values(np.array([1.5]))) for g in guesses] == [
        (1.5, 0.1), (1.5, 0.2), (1.5, 0.4), (1.5, 0.8),
    ]  # fmt: skip
    assert EFFECTS[NAME].targets(2, ()) == [EffectTarget(joint=0), EffectTarget(joint=1)]


def test_identification_recovers_it(injected: Path) -> None:
    result = identify(read_set(injected), effects=[f"{NAME}:joint2"], refine=True)
    found = {p.name: p for p in result.parameters if p.joint == "joint2"}
    for parameter, true in (("plateau", PLATEAU), ("speed", SPEED)):
        one = found[f"{NAME}.{parameter}"]
        assert one.value == pytest.approx(true, rel=0.01) and one.std is not None
        assert abs(one.value - true) < 5 * one.std


def test_diagnosis_names_it(injected: Path) -> None:
    found = diagnose(read_set(injected), apply=True)
    first = found.findings[0]
    assert (found.verdict, first.effect, first.joint) == ("missing", NAME, "joint2")
    assert found.steps[-1].verdict == "nothing-missing"


def test_it_is_listed_everywhere(capsys: pytest.CaptureFixture[str]) -> None:
    assert NAME in simulated_effects() and NAME in addable_effects()
    assert NAME in more_effects()["Motor side"]
    assert main(["effects"]) == 0 and NAME in capsys.readouterr().out
    assert main(["effects", NAME]) == 0
    words = " ".join(capsys.readouterr().out.split())
    assert "f_e: plateau [Nm], ≥ 0: friction at high speed" in words and "u opposes the motor" in words


def test_every_export_says_what_becomes_of_it() -> None:
    entries = {target: coverage()[NAME, target] for target in FORMATS}
    assert None not in entries.values()
    assert {target for target, entry in entries.items() if entry == NO_LAW} == {
        "c",
        "python",
        "table",
        "urdf",
        "mjcf",
    }


def test_its_page_and_picture_are_drawn() -> None:
    text = page(EFFECTS[NAME])
    assert text.startswith("# Saturating friction") and "u along a sweep of the speed" in text
    assert "<polyline" in draw(NAME)


def test_only_an_effects_own_file_compares_its_name() -> None:
    """Other rooms ask the effect; registries keyed by name are dicts and compare nothing."""
    wrong = []
    for path in sorted((ROOT / "flexviz").rglob("*.py")):
        if path.parent.name in ("effects", "exporting"):  # what a format writes is keyed by effect and format
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Compare):
                parts = [c for side in (node.left, *node.comparators) for c in ast.walk(side)]
            elif isinstance(node, ast.MatchValue):
                parts = [node.value]
            else:
                continue
            names = {part.value for part in parts if isinstance(part, ast.Constant)} & set(EFFECT_NAMES)
            wrong += [f"{path.relative_to(ROOT)}:{node.lineno} compares with {name}" for name in names]
    assert not wrong
