"""A delay of the torque on all joints or on single ones: its places, and its value in data."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flexviz
from flexviz.model.effects import EFFECTS, EffectTarget, choose_effects, everywhere
from tests.planar_arm import planar_set

PAIR = ("a", "b")


def test_it_is_offered_for_all_joints_and_for_each() -> None:
    law = EFFECTS["torque_delay"]
    assert law.targets(2, ()) == [EffectTarget(), EffectTarget(0), EffectTarget(1)]
    assert law.targets(1, ()) == [EffectTarget()]


def test_that_of_all_joints_replaces_those_of_single_ones() -> None:
    (every,) = choose_effects(["torque_delay"], PAIR)
    (one,) = choose_effects(["torque_delay:b"], PAIR)
    assert every.place == EffectTarget() and one.place == EffectTarget(1)
    assert one.text(PAIR) == "torque_delay:b"
    assert choose_effects(["torque_delay:b", "torque_delay", "torque_delay:a"], PAIR) == (every,)
    assert len(choose_effects(["torque_delay:a", "torque_delay:b"], PAIR)) == 2
    assert everywhere(one, [every]) and not everywhere(every, [one]) and not everywhere(one, [one])
    (gain,) = choose_effects(["torque_gain:b"], PAIR)
    assert not everywhere(gain, [every])


@pytest.mark.slow
def test_one_torque_that_is_stamped_late_is_estimated(tmp_path: Path) -> None:
    arm = planar_set(tmp_path / "set", [], seed=5, start="moving")
    groups = []
    for group in arm.groups:
        (segment,) = group.segments
        tau = segment.tau.copy()
        late = round(0.012 / segment.step)
        tau[late:, 1] = segment.tau[:-late, 1]
        part = slice(late, None)
        kept = replace(segment, time=segment.time[part], theta=segment.theta[part], tau=tau[part])
        groups.append(replace(group, segments=(kept,)))
    arm = replace(arm, groups=tuple(groups))
    found = flexviz.identify(arm, effects=["torque_delay:joint2"], refine=True)[
        "torque_delay.delay", "joint2"
    ]
    assert found.value == pytest.approx(-0.012, abs=2e-4) and np.isfinite(found.std)
