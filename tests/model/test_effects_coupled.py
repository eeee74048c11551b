"""Effects that only a search for many effects considers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexviz.analysis.diagnosis.candidates import candidates
from flexviz.analysis.identification import identify
from flexviz.base.errors import InputError
from flexviz.model.effects import EFFECTS, ChosenEffect, EffectTarget, choose_effects
from flexviz.model.equation import Layout
from flexviz.model.simulation import laws, make_plan
from tests.cases import slow
from tests.model.test_effects import MOTION, VALUES, named
from tests.planar_arm import planar_set

ONLY_AMONG_MANY = {
    "gravity_compensator",
    "coupled_friction",
    "directional_friction",
    "startup_friction",
    "thinning_friction",
}
JOINTS = ("joint1", "joint2", "joint3")


def test_coupled_friction_is_the_same_on_both_joints() -> None:
    effect, values = EFFECTS["coupled_friction"], np.array(VALUES["coupled_friction"])
    law = laws.coupled_friction(**named("coupled_friction"))
    speeds = [MOTION.theta(joint)[1].tolist() for joint in (0, 1)]
    expected = [law(*row) for row in zip(*speeds, strict=True)]
    for joint, pair in ((0, (0, 1)), (1, (1, 0))):
        terms = effect.terms(MOTION, EffectTarget(joint), values)
        assert terms.joints == pair
        np.testing.assert_allclose(terms.value[0], np.column_stack([expected] * 2), rtol=1e-12, atol=1e-12)


def test_every_pair_of_neighbours_once() -> None:
    effect = EFFECTS["coupled_friction"]
    assert effect.targets(3, ()) == [EffectTarget(0), EffectTarget(1)] and effect.targets(1, ()) == []
    pairs = choose_effects(["coupled_friction"], JOINTS)
    assert pairs == (ChosenEffect("coupled_friction", 0), ChosenEffect("coupled_friction", 1))
    assert choose_effects(["coupled_friction:joint3"], JOINTS) == (ChosenEffect("coupled_friction", 2),)
    with pytest.raises(InputError, match="needs a neighbouring joint"):
        choose_effects(["coupled_friction"], JOINTS[:1])
    hidden = make_plan("planar-2r", ["coupled_friction"]).model.effects
    assert [e.joint for e in hidden] == ["joint1"]


def test_a_search_for_single_effects_leaves_them_out() -> None:
    layout = Layout(JOINTS, (ChosenEffect("coulomb_friction", 1),))
    few, many = ({e.effect for e in candidates(layout, (), many=m)} for m in (False, True))
    assert many - few == ONLY_AMONG_MANY


@pytest.mark.parametrize(
    "hidden, truth",
    [
        ("coupled_friction:joint1", {"coulomb": 2.5, "viscous": 1.2}),
        slow("gravity_compensator:joint2", {"sine": 4.0, "cosine": -3.0}),
        slow("directional_friction:joint1", {"directional": -0.4}),
        ("thinning_friction:joint2", {"thinning": 1.2, "velocity": 0.2}),
    ],
)
def test_identification_recovers_them(hidden: str, truth: dict[str, float], tmp_path: Path) -> None:
    values = ",".join(f"{name}={value}" for name, value in truth.items())
    measurements = planar_set(tmp_path / "set", [f"{hidden}:{values}"], seed=3)
    result = identify(measurements, effects=[hidden], refine=True)
    name, _, joint = hidden.partition(":")
    for parameter, true in truth.items():
        (found,) = (p for p in result.parameters if (p.name, p.joint) == (f"{name}.{parameter}", joint))
        assert found.std is not None and abs(found.value - true) < 5 * found.std + 1e-3 * abs(true), found
