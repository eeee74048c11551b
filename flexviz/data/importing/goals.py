"""Goals that no servo has followed: constant, in another unit than the position, or of another joint."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexviz.base.errors import InputError
from flexviz.base.facts import Fact
from flexviz.data.importing.goal_units import known_units
from flexviz.data.logs import AssembledGroup, Mapping, Proposal, followed, joint_parts
from flexviz.data.measurements import FARTHEST, LEAST_GOALS, Array
from flexviz.robot.robot import Robot

FOLLOWS = 0.6  # squared correlation with the position from which its factor is trusted
SAME_UNIT = 10.0  # times the position's motion, or its inverse, by which a goal in the same unit may move
NEAR = 5.0  # the same for a goal in the right unit


@dataclass(frozen=True)
class GoalFault:
    """What is wrong with one joint's goals in a log, and the keys that mend it."""

    log: str
    column: str
    fact: Fact
    proposals: tuple[Proposal, ...] = ()

    @property
    def message(self) -> str:
        """Found, expected, remedy."""
        return self.fact.text

    def error(self) -> InputError:
        """The fault, as it is refused."""
        remedy = f"; state {' and '.join(map(str, self.proposals))}" if self.proposals else ""
        return InputError(self.message + remedy, file=self.log, place=f"column {self.column}")


def goal_faults(mapping: Mapping, robot: Robot, groups: Sequence[AssembledGroup]) -> list[GoalFault]:
    """Goals in another unit than the position or of another joint, at most one fault per joint."""
    found = (goal_fault(mapping, robot, j, groups) for j in range(robot.n))
    return [fault for fault in found if fault is not None]


def constant_goals(mapping: Mapping, groups: Sequence[AssembledGroup]) -> list[GoalFault]:
    """Goals that do not change in any log."""
    found = []
    for j, (joint, entry) in enumerate(mapping.joints.items()):
        goals = [g.table.theta_ref[:, j] for g in groups if g.table.theta_ref is not None]
        if entry.theta_ref is not None and all(len(np.unique(goal)) < LEAST_GOALS for goal in goals):
            stands = Fact("goal-stands", "wrong", (joint,), values={"at": float(goals[0][0])})
            found.append(GoalFault(groups[0].entry.label, entry.theta_ref.column, stands))
    return found


def goal_fault(mapping: Mapping, robot: Robot, j: int, groups: Sequence[AssembledGroup]) -> GoalFault | None:
    """What is wrong with the goals of joint j."""
    joint = mapping.names[j]
    signal = mapping.joints[joint].theta_ref
    assert signal is not None
    unit = "m" if robot.prismatic[j] else "rad"
    pairs = [(g.table.theta[:, j], g.table.theta_ref[:, j]) for g in groups if g.table.theta_ref is not None]

    def fault(k: int, fact: Fact, *proposals: Proposal) -> GoalFault:
        fact = replace(fact, severity="wrong", joints=(joint,), values={**fact.values, "unit": unit})
        return GoalFault(groups[k].entry.label, signal.column, fact, proposals)

    share, slope = followed(joint_parts([group.table for group in groups], j, "theta_ref"))
    if slope is None:
        return None
    ahead = [goal - theta for theta, goal in pairs]
    away = [float(np.median(np.abs(x))) for x in ahead]
    k = int(np.argmax(away))
    if slope < 0 and share > FOLLOWS:
        key = Proposal(("joints", joint, "theta_ref"), "sign", -signal.sign)
        return fault(k, Fact("goal-turned"), key)
    if share > FOLLOWS and not 1 / SAME_UNIT < slope < SAME_UNIT:
        proposals = unit_of(mapping, robot, j, pairs, slope)
        return fault(k, Fact("goal-unit", values={"times": slope}), *proposals)
    if away[k] <= FARTHEST:
        return None
    if share <= FOLLOWS:
        return fault(k, Fact("goal-of-another", values={"away": away[k]}))
    offset = round(signal.offset - float(np.median(np.concatenate(ahead))), 6)
    key = Proposal(("joints", joint, "theta_ref"), "offset", offset)
    return fault(k, Fact("goal-zero", values={"away": away[k]}), key)


def unit_of(
    mapping: Mapping, robot: Robot, j: int, pairs: Sequence[tuple[Array, Array]], slope: float
) -> tuple[Proposal, ...]:
    """The keys of the unit in which the goals of joint j are nearest to θ; none where none is near."""
    joint = mapping.names[j]
    signal = mapping.joints[joint].theta_ref
    assert signal is not None
    theta, goal = (np.concatenate(part) for part in zip(*pairs, strict=True))
    now = mapping.joints[joint].scale(signal)
    raw = (goal - signal.offset) / now
    near = [x for x in known_units(robot) if 1 / NEAR < slope * x.size[j] / now < NEAR]
    if robot.prismatic[j] or not near:
        return ()
    best = min(near, key=lambda x: float(np.median(np.abs(raw * x.size[j] + x.zero[j] - theta))))
    keys = {"unit": "rad", **best.keys(j)}
    keys |= {"offset": 0.0} if signal.offset and "offset" not in keys else {}
    return tuple(Proposal(("joints", joint, "theta_ref"), key, value) for key, value in keys.items())
