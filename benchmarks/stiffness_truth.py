"""Stiffness under model error, against the truth: `python -m benchmarks.stiffness_truth --sets N --seed S`.

Planar arms and UR5 of `benchmarks.robotlike_study` in three classes of stiffness. Their friction is in no
library: it builds up over a presliding distance, falls with speed by a power, grows with the square root of
speed, and depends on position and direction. Encoders and torques are quantised, the torque is a filtered
current, and it is recorded late. `--with` names which of these errors the sets have, to see what each does.

Each set is identified with Coulomb friction on every joint, as its user would, `--refine` adds the
refinement, `--diagnose` takes the last model of `diagnose --apply`. Printed: each marked stiffness, then
how often the stated 95 % intervals contain the truth, and the errors.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import cos, sqrt, tanh
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import numpy as np

from benchmarks.command import command
from benchmarks.diagnosis_study.judging import Value
from benchmarks.diagnosis_study.motions import workload
from benchmarks.diagnosis_study.robots import stiff_plan
from benchmarks.robotlike_study.cases import RobotCase
from benchmarks.robotlike_study.making import integration_step, write_case
from benchmarks.running import case_folder, is_made, read, say, truth_file
from flexviz.analysis import diagnosis
from flexviz.analysis.identification import identify
from flexviz.data.measurements import read_set
from flexviz.model.effects import JointState
from flexviz.model.simulation import ExtraLaw, Plan, Pull, Run, Sensors

ROBOTS = ("2r", "ur5")
CLASSES = {"series-elastic": 0.03, "strain-wave": 0.4, "stiff": 4.0}  # times that of the study's robots
ERRORS = ("friction", "sensors", "filter", "delay")
FRICTION = (0.01, 0.2)  # sliding friction over the standard deviation of the joint's torque, of a set ...
JOINTS = (0.7, 1.4)  # ... and of its joints relative to it
PRESLIDING = (5e-4, 5e-3)  # [rad] over which friction builds up
FILTER_HERTZ = (20.0, 300.0)  # of the recorded current
LATE = (0, 2)  # samples of the record


@dataclass(frozen=True)
class StrangeFriction(ExtraLaw):
    """f (1 + d) (1 + a cos(3θ + φ)) (1 + 1/(1 + |v/v₀|^1.5) + √|v/v₁|) z, ż = (v − |v| z)/x₀.

    d is ± the difference of the two directions.
    """

    torque: float  # f [Nm]
    distance: float  # x₀ [rad]
    fall: float  # v₀ [rad/s]
    growth: float  # v₁ [rad/s]
    direction: float  # d [-]
    amplitude: float  # a [-]
    phase: float  # φ [rad]
    states = 1

    def pull(self, at: JointState) -> Pull:
        speed, z = at.theta_velocity, at.z[0]
        place = 1.0 + self.amplitude * cos(3.0 * at.theta + self.phase)
        side = 1.0 + self.direction * tanh(z)
        size = 1.0 + 1.0 / (1.0 + abs(speed / self.fall) ** 1.5) + sqrt(abs(speed / self.growth))
        torque = self.torque * side * place * size * z
        return Pull(motor=torque, rates=((speed - abs(speed) * z) / self.distance,))


@dataclass(frozen=True)
class Planned:
    """One set before its simulation.

    Attributes:
        case: name and random numbers.
        stiffness: its class.
        late: samples by which the torque is recorded late.
        plan: with friction and sensors.
    """

    case: RobotCase
    stiffness: str
    late: int
    plan: Plan

    def logged(self, run: Run) -> Run:
        """What is recorded: the torque of `late` samples before."""
        if not self.late:
            return run
        before = np.repeat(run.tau[:1], self.late, axis=0)
        return replace(run, tau=np.concatenate((before, run.tau))[: len(run.tau)])


def planned(seed: int, number: int, errors: Iterable[str] = ERRORS) -> Planned:
    """Set `number` of a seed with these errors; robot and motion do not depend on them."""
    robot = ROBOTS[number % len(ROBOTS)]
    stiffness = list(CLASSES)[number // len(ROBOTS) % len(CLASSES)]
    marks = "".join(name[:2] for name in ERRORS if name in errors) or "clean"
    case = RobotCase(f"k{seed}-{number:03d}-{robot}-{stiffness}-{marks}", robot, seed)
    same = replace(case, name=f"k{seed}-{number:03d}")  # random numbers
    plan = stiff_plan(robot, same.duration, same.rng("robot"))
    model = replace(plan.model, stiffness=CLASSES[stiffness] * plan.model.stiffness)
    initial = plan.initial_stiffness
    assert initial is not None
    plan = replace(plan, model=model, initial_stiffness=CLASSES[stiffness] * initial)
    rng = same.rng("errors")
    work, laws = workload(plan), []
    shortest = 0.2 * PRESLIDING[0]  # [rad] per step, at the rms speed
    level = np.exp(rng.uniform(*np.log(FRICTION)))
    for joint, torque, speed in zip(plan.robot.joints, work.torque, work.speed, strict=True):
        size = torque * level * rng.uniform(*JOINTS)
        distance, phase = np.exp(rng.uniform(*np.log(PRESLIDING))), rng.uniform(0.0, 2 * np.pi)
        fall, growth = speed * rng.uniform((0.05, 2.0), (0.3, 8.0))
        direction, amplitude = rng.uniform((-0.3, 0.0), (0.3, 0.3))
        law = StrangeFriction(size, distance, fall, growth, direction, amplitude, phase)
        laws.append((joint, law))
    hertz, late = np.exp(rng.uniform(*np.log(FILTER_HERTZ))), int(rng.integers(LATE[0], LATE[1] + 1))
    sensors = replace(plan.sensors, torque_filter=2 * np.pi * hertz if "filter" in errors else 0.0)
    if "sensors" not in errors:
        sensors = Sensors(torque_filter=sensors.torque_filter)
    plan = replace(plan, sensors=sensors, laws=tuple(laws) if "friction" in errors else ())
    plan = replace(plan, step=min(integration_step(plan), shortest / max(np.max(work.speed), 1e-9)))
    return Planned(case, stiffness, late if "delay" in errors else 0, plan)


@dataclass(frozen=True)
class Judged(Value):
    """One stiffness [Nm/rad] of one set and its grade, "yes", "weak" or "no"."""

    grade: str

    def text(self) -> str:
        inside = "" if self.grade == "no" else "covered" if self.covered else "OUTSIDE"
        share = f"{100 * self.std / self.found:.3g} %" if self.std and np.isfinite(self.std) else "–"
        values = f"true {self.true:9.4g}  found {self.found:9.4g} ± {share:8s}"
        return f"{self.name:44s} {values} {self.grade:5s}{inside}"


def judge(work: Path, one: Planned, how: str) -> list[Judged]:
    """All stiffnesses of a set."""
    if not is_made(work, one.case.name):
        write_case(work, one.case, one.plan, ("friction",) * len(one.plan.laws), one.logged)
    truth = read(truth_file(work, one.case.name))["stiffness"]
    measurements = read_set(case_folder(work, one.case.name))
    if how == "diagnose":
        found = diagnosis.diagnose(measurements, apply=True).parameters
    else:
        found = identify(measurements, effects=["coulomb_friction"], refine=how == "refine").parameters
    stiffness = {p.joint: p for p in found if p.name == "stiffness"}
    out = []
    for joint, true in zip(one.plan.robot.joints, truth, strict=True):
        p = stiffness[joint]
        out.append(Judged(f"{one.case.name} {joint[:10]}", true, p.value, p.std, p.identifiable))
    return out


def summary(judged: Sequence[Judged]) -> str:
    """Coverage and errors of what is marked."""
    lines = []
    for grades in (("yes",), ("weak",), ("yes", "weak")):  # "no" has no interval
        some = [j for j in judged if j.grade in grades]
        text = f"{' and '.join(grades):13s} {len(some):3d} of {len(judged)}"
        if some:
            text += f": {np.mean([bool(j.covered) for j in some]):.0%} of the intervals contain the truth, "
            text += f"error {100 * np.median([j.error for j in some]):.3g} % in the median, "
            text += f"{np.mean([j.found < j.true for j in some]):.0%} too soft"
        lines.append(text)
    return "\n".join(lines)


@command
def main(
    *,
    sets: int = 8,
    first: Annotated[int, "number of the first set"] = 0,
    seed: int = 1,
    with_: Annotated[str, "errors of the sets, or clean"] = ",".join(ERRORS),
    work: Annotated[Path | None, "folder that keeps the sets"] = None,
    refine: bool = False,
    diagnose: bool = False,
) -> None:
    judged, how = list[Judged](), "refine" if refine else "diagnose" if diagnose else "plain"
    with TemporaryDirectory() as folder:
        for number in range(first, first + sets):
            one = planned(seed, number, with_.split(","))
            try:
                found = judge(work or Path(folder), one, how)
            except ArithmeticError as error:  # a simulation that diverged has no truth to compare with
                say(f"{one.case.name}: {error}")
                continue
            judged += found
            for j in found:
                print(j.text(), flush=True)
    print(summary(judged))


if __name__ == "__main__":
    sys.exit(main())
