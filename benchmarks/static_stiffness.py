"""Stiffness by a static test: `python -m benchmarks.static_stiffness [--seed N] [--sets N]`.

UR5 arms of the independent simulator, whose motion shows the stiffness of few joints. Their flange is then
clamped and each motor pushes both ways in steps, while all joints are recorded. The pushes are simulated
here, with friction that has a presliding regime, depends on load, and differs from push to push; they share
no code with the estimator. Each set is identified from its motion alone and with the pushes. Told are the
stiffnesses that the motion shows, the largest error with the pushes, and how often the 95 % intervals hold
the truth.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet

from benchmarks.command import command
from benchmarks.independent import make_case
from flexviz import identify, read_set
from flexviz.base.arrays import Array

ROBOT, SECONDS = "ur5", 6.0  # of each motion
PUSH = np.array([40.0, 40.0, 30.0, 10.0, 10.0, 10.0])  # [Nm] of the motors of a UR5
LEVELS, PASSES = 7, 2  # torques from −PUSH to PUSH, up and down again, and how often
FRICTION = 0.1  # of the largest push
LOADED, SCATTER = 0.03, 0.05  # friction by load [-]; how it differs from push to push, relative
PRESLIDING = 2e-4  # [rad] of the motor until it slides
RAMP, HOLD = 0.6, 1.0  # [s] to the next level, and there
STEP, RECORDED = 5e-4, 0.01  # [s]
ENCODER, TORQUE = 1e-5, 0.02  # standard deviations of the noise [rad], [Nm]


def clamped_pushes(
    stiffness: Array, motor_inertia: Array, pose: Array, rng: np.random.Generator
) -> tuple[Array, Array, Array]:
    """Time (N,), θ and τ (N, n) of an arm with a clamped flange whose motors push one after the other."""
    n = len(stiffness)
    up = np.linspace(-1, 1, LEVELS)
    levels: Array = np.concatenate([[0.0], *[np.concatenate([up, up[::-1]]) for _ in range(PASSES)], [0.0]])
    kp, kd = 0.2 * stiffness, 2 * np.sqrt(1.2 * stiffness * motor_inertia)
    wanted = levels[:, None] * PUSH * (1 / kp + 1 / stiffness)  # references of the joints' controllers
    friction = FRICTION * PUSH * rng.uniform(0.7, 1.3, n)
    theta, speed, bristle = np.zeros(n), np.zeros(n), np.zeros(n)
    every, out_theta, out_tau = round(RECORDED / STEP), [], []
    for before, after in pairwise(wanted):
        scatter = 1 + SCATTER * rng.standard_normal(n)
        for k in range(round((RAMP + HOLD) / STEP)):
            share = min(k * STEP / RAMP, 1.0)
            tau = kp * (before + share * (after - before) - theta) - kd * speed
            spring = stiffness * theta
            most = (friction + LOADED * np.abs(spring)) * scatter
            bristle = np.clip(bristle + speed * STEP / PRESLIDING, -1.0, 1.0)
            speed = speed + STEP * (tau - spring - most * bristle - 0.2 * kd * speed) / motor_inertia
            theta = theta + STEP * speed
            if k % every == 0:
                out_theta.append(theta)
                out_tau.append(tau)
    alone_theta, alone_tau = np.array(out_theta), np.array(out_tau)
    rows = len(alone_theta)
    whole_theta, whole_tau = (np.repeat(x[-1:], n * rows, axis=0) for x in (alone_theta, alone_tau))
    for j in range(n):  # one after the other; the others rest as they ended or will begin
        whole_theta[: j * rows, j], whole_tau[: j * rows, j] = alone_theta[0, j], alone_tau[0, j]
        whole_theta[j * rows : (j + 1) * rows, j] = alone_theta[:, j]
        whole_tau[j * rows : (j + 1) * rows, j] = alone_tau[:, j]
    whole_theta = pose + whole_theta + ENCODER * rng.standard_normal(whole_theta.shape)
    whole_tau = whole_tau + TORQUE * rng.standard_normal(whole_tau.shape)
    time: Array = RECORDED * np.arange(n * rows, dtype=np.float64)
    return time, whole_theta, whole_tau


def add_pushes(folder: Path, truth: dict[str, Any], rng: np.random.Generator) -> None:
    """Write the static test into a set, by hand."""
    joints = truth["joints"]
    pose = np.array([0.0, -1.2, 1.2, -0.5, 0.5, 0.0])
    stiffness, inertia = np.array(truth["stiffness"]), np.array(truth["motor_inertia"])
    time, theta, tau = clamped_pushes(stiffness, inertia, pose, rng)
    columns = {"time": time}
    for j, joint in enumerate(joints):
        columns |= {f"theta_{joint}": theta[:, j], f"tau_{joint}": tau[:, j]}
    parquet.write_table(pa.table(columns), folder / "pushes.parquet")
    with (folder / "measurements.toml").open("a") as file:
        file.write(
            '\n[[groups]]\nname = "pushes"\ntrajectory = "pushes"\npayload = "p1"\n'
            'kind = "holds"\nclamped = true\nfile = "pushes.parquet"\n'
        )


@dataclass(frozen=True)
class StaticOutcome:
    """One arm's stiffnesses.

    Attributes:
        shown: how many are "yes" by the motion alone.
        grades: with the pushes.
        errors: relative, with the pushes.
        covered: whether each 95 % interval holds the truth.
    """

    shown: int
    grades: tuple[str, ...]
    errors: tuple[float, ...]
    covered: tuple[bool, ...]


def outcome(seed: int, refine: bool = True) -> StaticOutcome:
    """Simulate an arm and identify it, without and with the pushes."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        truth = make_case(seed, "none", ROBOT, folder, duration=SECONDS)
        motion = identify(read_set(folder, logged=False), refine=refine)
        add_pushes(folder, truth, np.random.default_rng([seed, 1]))
        found = identify(read_set(folder, logged=False), refine=refine)
    before, after = ([p for p in one.parameters if p.name == "stiffness"] for one in (motion, found))
    errors = np.array([p.value for p in after]) / np.array(truth["stiffness"]) - 1
    stds = np.array([p.std / p.value for p in after])
    return StaticOutcome(
        sum(p.identifiable == "yes" for p in before),
        tuple(p.identifiable for p in after),
        tuple(errors.tolist()),
        tuple((np.abs(errors) < 1.96 * stds).tolist()),
    )


@command
def main(*, seed: int = 1, sets: int = 50, plain: Annotated[bool, "without refining"] = False) -> None:
    """Print a line per set and the totals."""
    done: list[StaticOutcome] = []
    for k in range(sets):
        one = outcome(1000 * seed + k, not plain)
        done.append(one)
        errors = " ".join(f"{100 * error:+5.2f}" for error in one.errors)
        print(
            f"set {k:2d}: motion alone shows {one.shown} of 6; with pushes {one.grades.count('yes')} of 6, "
            f"off by [%] {errors}, intervals hold {sum(one.covered)} of 6",
            flush=True,
        )
    errors = np.abs([one.errors for one in done])
    covered = np.mean([one.covered for one in done])
    print(
        f"{len(done)} sets: motion alone shows {np.mean([one.shown for one in done]):.1f} of 6 stiffnesses; "
        f"with the pushes the largest error is {100 * errors.max():.2f} %, "
        f"the median {100 * np.median(errors):.2f} %; "
        f"95 % intervals hold the truth in {100 * covered:.1f} %"
    )


if __name__ == "__main__":
    sys.exit(main())
