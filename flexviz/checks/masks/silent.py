"""Torques that are no signal: constant, of two or three values, or unrelated to the motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from flexviz.base.arrays import Array
from flexviz.checks.issues import Issue
from flexviz.checks.samples import AllSamples, GroupSamples, mask
from flexviz.checks.set_samples import samples_of
from flexviz.data.logs import Proposal
from flexviz.data.measurements import MeasurementSet, SampledMotion, sample_motion
from flexviz.robot.robot import Robot

FEW_VALUES = 3  # of a torque, which tell its direction at most
LEAST_SHARE = 0.2  # of a torque's variance that the motion explains; below, it may be unrelated
SHIFTS = 19  # comparisons with the motion at other times: one in twenty of unrelated torques passes
LEAST_MOTION = 1e-3  # [rad], [m] by which a joint has to move, for its torque to be missed

SilentTorque = dict[str, Any]  # "values": the few that it has; or "share": of it that the motion explains


def silent_joints(measurements: MeasurementSet) -> dict[str, SilentTorque]:
    """Joints of a set whose torque is no signal although they move -> what it is instead.

    Joints that the set states in `no_torque` are not named.
    """
    return silent_torques(samples_of(measurements))


@mask
def silent(samples: AllSamples) -> Iterator[Issue]:
    """Torques that are no signal although their joints move: one issue, with the key that leaves them out."""
    stated, found = samples.no_torque, silent_torques(samples)
    if found and len(found) + len(stated) < samples.robot.n:
        key = Proposal(("model",), "no_torque", [*stated, *found])
        yield Issue("no_torque", "odd", tuple(found), "tau", {"what": found}, proposals=(key,))


def silent_torques(samples: AllSamples) -> dict[str, SilentTorque]:
    """Joints whose torque is no signal although they move, and not said so -> what it is instead."""
    out: dict[str, SilentTorque] = {}
    robot, runs = samples.robot, samples.groups
    if not runs:
        return out
    motions = [(run, sample_motion(run.time, run.theta, run.tau)) for run in runs]
    columns = [_explaining(robot, run, motion) for run, motion in motions]
    for j, joint in enumerate(robot.joints):
        still = max(float(np.ptp(run.theta[:, j])) for run in runs) < LEAST_MOTION
        if still or joint in samples.no_torque:
            continue
        values = np.unique(np.concatenate([np.unique(run.tau[:, j]) for run in runs]))
        if len(values) <= FEW_VALUES:
            out[joint] = {"values": tuple(map(float, values))}
        else:
            share = _unrelated([x[:, j] for x in columns], [m.torque[:, j] for _, m in motions])
            if share is not None:
                out[joint] = {"share": share}
    return out


def _explaining(robot: Robot, run: GroupSamples, motion: SampledMotion) -> Array:
    """What may explain each joint's torque: CAD gravity and inertia, friction, own inertia: (M, n, 6)."""
    still = np.zeros_like(motion.q)
    gravity = robot.cad_torques(run.bodies, motion.q, still, still)
    whole = robot.cad_torques(run.bodies, motion.q, motion.v, motion.a)
    speed = np.abs(motion.v).max(axis=0) + 1e-12
    friction = np.tanh(30 * motion.v / speed)
    columns = (gravity, whole - gravity, motion.a, motion.v, friction, np.ones_like(still))
    return np.stack(columns, axis=2)


def _unrelated(columns: Sequence[Array], torque: Sequence[Array]) -> float | None:
    """The share of a joint's torque that its motion explains, if that is no more than by chance.

    Chance is what the motion at other times explains: each run's torque turned round against it.

    Args:
        columns: of each run, shape (M, P).
        torque: of each run, shape (M,).
    """
    whole = np.concatenate(columns)
    scale = np.linalg.norm(whole, axis=0)
    left, size, _ = np.linalg.svd(whole / np.where(scale > 0, scale, 1.0), full_matrices=False)
    left = left[:, size > 1e-6 * size[0]]

    def share(turned: float) -> float:
        tau = np.concatenate([np.roll(t, round(turned * len(t))) for t in torque])
        tau = tau - tau.mean()
        return float(np.sum((left.T @ tau) ** 2) / max(float(tau @ tau), 1e-300))

    found = share(0.0)
    if found >= LEAST_SHARE:
        return None
    others = [share(turned) for turned in np.linspace(0.1, 0.9, SHIFTS)]
    return found if found <= max(others) else None
