"""Laws that no library has, hidden in some of the robots."""

from __future__ import annotations

from collections.abc import Callable
from math import pi

import numpy as np

from benchmarks.diagnosis_study.laws import FrictionBump, OneWayPatch, Saturation, SawtoothCogging, Vibration
from benchmarks.robotlike_study.effects import Place
from benchmarks.robotlike_study.motions import Workload
from flexviz.simulation import ExtraLaw, Plan

NUMBERS = (0.5, 0.35, 0.15)  # probability of none, one, two
SIZES = (0.12, 0.7)  # largest torque over the spread of the joint's torque


def _inside(at: Place) -> float:
    """An angle in the middle of what the joint passes [rad]."""
    return float(at.rng.uniform(at.work.low[at.i], at.work.high[at.i]))


def _friction_bump(at: Place) -> ExtraLaw:
    return FrictionBump(at.part(*SIZES), _inside(at), float(at.rng.uniform(0.1, 0.25)))


def _one_way_patch(at: Place) -> ExtraLaw:
    return OneWayPatch(at.part(*SIZES), _inside(at))


def _sawtooth(at: Place) -> ExtraLaw:
    return SawtoothCogging(at.part(0.08, 0.3), float(at.rng.integers(3, 9)))


def _saturation(at: Place) -> ExtraLaw:
    return Saturation(at.log_uniform(0.01, 0.05), float(at.work.torque[at.i]))


def _vibration(at: Place) -> ExtraLaw:
    return Vibration(at.part(0.05, 0.3), float(at.rng.uniform(1.5, 6.0)), float(at.rng.uniform(-pi, pi)))


LAWS: dict[str, tuple[float, Callable[[Place], ExtraLaw]]] = {
    "friction_bump": (0.45, _friction_bump),
    "one_way_patch": (0.2, _one_way_patch),
    "sawtooth_cogging": (0.2, _sawtooth),
    "saturation": (0.05, _saturation),
    "vibration": (0.1, _vibration),
}
"""Law → its probability and its random parameters."""


def draw_laws(plan: Plan, work: Workload, rng: np.random.Generator) -> list[tuple[str, str, ExtraLaw]]:
    """Kind, joint and law of what no library has, on different joints."""
    number = int(rng.choice(len(NUMBERS), p=NUMBERS))
    joints = rng.permutation(plan.robot.n)[:number]
    out = []
    for i in joints.tolist():
        kind = str(rng.choice(list(LAWS), p=[chance for chance, _ in LAWS.values()]))
        out.append((kind, plan.robot.joints[i], LAWS[kind][1](Place(i, plan, work, 0.0, rng))))
    return out
