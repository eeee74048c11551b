"""Held-out groups in which the robot stands still do not judge effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flexviz.analysis.diagnosis import diagnose
from flexviz.analysis.diagnosis.notes import without_still_groups
from flexviz.data.measurements import Group, MeasurementSet


def held(group: Group, joints: Sequence[int]) -> Group:
    """The group with joints that stand still, where friction holds them against 2 Nm."""

    def at_rest(segment: Any) -> Any:
        theta, tau = segment.theta.copy(), segment.tau.copy()
        rng = np.random.default_rng(0)
        for j in joints:
            theta[:, j] = theta[0, j] + 1e-6 * rng.standard_normal(len(theta))
            tau[:, j] = 2.0 + 0.01 * rng.standard_normal(len(tau))
        return replace(segment, theta=theta, tau=tau)

    return replace(group, segments=tuple(at_rest(s) for s in group.segments))


def with_held_out(demo: MeasurementSet, joints: Sequence[int], beside: bool = False) -> MeasurementSet:
    """The set with its held-out groups standing still, or with such a group beside them."""
    still = [held(g, joints) for g in demo.validation_groups]
    moving = demo.validation_groups if beside else ()
    still = [replace(g, name=f"still {g.name}") for g in still]
    return replace(demo, groups=(*demo.fit_groups, *moving, *still))


@pytest.mark.parametrize(("joints", "counts"), [((0, 1), False), ((0,), True), ((1,), True)])
def test_a_group_counts_where_any_joint_moves(
    demo: MeasurementSet, joints: tuple[int, ...], counts: bool
) -> None:
    given = with_held_out(demo, joints, beside=True)
    kept, notes = without_still_groups(given)
    assert kept.fit_groups == given.fit_groups
    assert set(demo.validation_groups) <= set(kept.validation_groups)
    assert (len(kept.groups) == len(given.groups)) == counts
    assert [note.kind for note in notes] == ([] if counts else ["groups-at-rest"])
    assert counts or "the robot stands still" in notes[0].text


def test_friction_is_found_although_the_held_out_robot_stands_still(demo: MeasurementSet) -> None:
    result = diagnose(with_held_out(demo, (0, 1)), apply=True, guard=False)
    added = [step.added for step in result.steps if step.added is not None]
    assert [(f.effect, f.joint) for f in added] == [("coulomb_friction", "joint2")]
    assert added[0].parameters["coulomb"].value == pytest.approx(3.0, rel=0.02)
    assert result.steps[-1].verdict == "nothing-missing"
    assert any(note.text.startswith("held-out") for note in result.notes)
