"""Rigid joints, and joints without a torque: `python -m benchmarks.rigid_joints [--seed N] [--sets N]`.

Sets of the independent simulator with Coulomb friction, in which one joint of a planar arm, or two of a UR5,
are rigid: its motor is locked to the link. Each is identified as it is, where a rigid joint may get no
stiffness "yes", and once more with the joints stated in `[model] rigid`. Then sets of a UR5 in which the
torque of one joint is replaced by a channel without a signal: it has to be found, and with `[model]
no_torque` the held-out errors of the other joints are compared with those of the same set with the signal.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from tempfile import TemporaryDirectory
from typing import Annotated

import numpy as np

from benchmarks.command import command
from benchmarks.independent import make_case
from flexviz import identify, read_set
from flexviz.checks import silent_joints
from flexviz.data.measurements import Array, MeasurementSet

KIND = "coulomb_friction"  # hidden on one joint; the model has it on all
SECONDS = 8.0  # of a run
CHANNELS = ("three values", "constant", "noise")


@dataclass(frozen=True)
class RigidOutcome:
    """What one set with rigid joints gives.

    Attributes:
        false: rigid joints with a stiffness "yes".
        said: share of the rigid joints that are said to be rigid within what the motion shows.
        errors: relative errors of the stiffnesses "yes" of the elastic joints, with the rigid ones stated.
        elastic: number of elastic joints.
    """

    false: int
    said: float
    errors: tuple[float, ...]
    elastic: int


def rigid_outcome(seed: int, robot: str, rigid: tuple[int, ...], refine: bool = True) -> RigidOutcome:
    """Simulate a set and identify it, without and with its rigid joints stated."""
    with TemporaryDirectory() as folder:
        truth = make_case(seed, KIND, robot, folder, rigid=rigid, duration=SECONDS)
        measurements = read_set(folder, logged=False)
    names = [measurements.joints[j] for j in rigid]
    found = identify(measurements, effects=[KIND], refine=refine)
    own = [found["stiffness", name] for name in names]
    stated = identify(replace(measurements, rigid=tuple(names)), effects=[KIND], refine=refine)
    elastic = [p for p in stated.parameters if p.name == "stiffness"]
    true = dict(zip(measurements.joints, truth["stiffness"], strict=True))
    errors = [p.value / true[str(p.joint)] - 1 for p in elastic if p.identifiable == "yes"]
    return RigidOutcome(
        sum(p.identifiable == "yes" for p in own),
        float(np.mean([p.rigid_above is not None for p in own])),
        tuple(errors),
        len(elastic),
    )


def spoilt(
    measurements: MeasurementSet, joint: int, channel: str, rng: np.random.Generator
) -> MeasurementSet:
    """The set with a torque channel that is no signal."""

    def of(tau: Array) -> Array:
        made = tau.copy()
        noise = rng.standard_normal(len(tau))
        made[:, joint] = {
            "three values": 0.001 * np.round(0.4 * noise).clip(-1, 1),
            "constant": np.zeros(len(tau)),
            "noise": 0.02 * noise,
        }[channel]
        return made

    groups = [
        replace(g, segments=tuple(replace(s, tau=of(s.tau)) for s in g.segments)) for g in measurements.groups
    ]
    return replace(measurements, groups=tuple(groups))


def torque_outcome(seed: int, robot: str, joint: int, channel: str) -> tuple[bool, float]:
    """Whether the joint alone is named, and the largest ratio of another joint's held-out error."""
    with TemporaryDirectory() as folder:
        make_case(seed, KIND, robot, folder, duration=SECONDS)
        whole = read_set(folder, logged=False)
    name = whole.joints[joint]
    without = spoilt(whole, joint, channel, np.random.default_rng(seed))
    named = list(silent_joints(without)) == [name]
    stated = spoilt(replace(whole, no_torque=(name,)), joint, "constant", np.random.default_rng(seed))
    before, after = (identify(one, effects=[KIND]).residual.rms_validation for one in (whole, stated))
    assert before is not None and after is not None
    ratios = np.delete(np.array(after), joint) / np.delete(np.array(before), joint)
    return named, float(ratios.max())


@command
def main(
    *, seed: int = 1, sets: Annotated[int, "with rigid joints; half as many without a torque"] = 20
) -> int:
    """Print a line per set and the totals; 1 where a rigid joint got a stiffness "yes"."""
    rng = np.random.default_rng(seed)
    outcomes: list[RigidOutcome] = []
    for k in range(sets):
        robot, n, count = (("2r", 2, 1), ("ur5", 6, 2))[k % 3 == 2]
        rigid = tuple(sorted(int(j) for j in rng.choice(n, count, replace=False)))
        one = rigid_outcome(1000 * seed + k, robot, rigid)
        outcomes.append(one)
        errors = ", ".join(f"{100 * error:+.2f}" for error in one.errors) or "none"
        print(
            f"{robot:4s} rigid {rigid!s:7s} stiffness yes on rigid joints {one.false}, said to be rigid "
            f"{100 * one.said:.0f} %; elastic yes {len(one.errors)} of {one.elastic}, off by [%] {errors}",
            flush=True,
        )
    worst = max((abs(error) for one in outcomes for error in one.errors), default=np.nan)
    false = sum(one.false for one in outcomes)
    print(
        f"{len(outcomes)} sets: {false} rigid joints with a stiffness yes; said to be rigid "
        f"{100 * np.mean([one.said for one in outcomes]):.0f} %; elastic stiffnesses yes "
        f"{sum(len(one.errors) for one in outcomes)} of {sum(one.elastic for one in outcomes)}, at most "
        f"{100 * worst:.2f} % off"
    )
    named, largest = 0, 0.0
    for k in range(sets // 2):
        joint, channel = int(rng.integers(6)), CHANNELS[k % 3]
        found, ratio = torque_outcome(1000 * seed + 500 + k, "ur5", joint, channel)
        named, largest = named + found, max(largest, ratio)
        print(f"ur5 joint {joint + 1} {channel:12s} named {found}, others' error at most {ratio:.3f} times")
    print(
        f"{sets // 2} sets: {named} named alone; the other joints' held-out error at most "
        f"{largest:.3f} times that with the signal"
    )
    return int(false > 0)


if __name__ == "__main__":
    sys.exit(main())
