"""Which effects a robot hides, and how large they are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import pi

import numpy as np

from benchmarks.robotlike_study.motions import Workload
from flexviz.model import EffectValue
from flexviz.simulation import Plan

NUMBERS = {"2r": (3, 10), "ur5": (7, 15), "panda": (8, 15)}
"""Robot → smallest and largest number of effects of the library, Coulomb friction included."""
FRICTIONS = {"coulomb_friction": 0.85, "link_coulomb_friction": 0.05, "presliding_hysteresis": 0.06, "": 0.04}
"""What resists the start of a joint → its probability; "" for nothing."""


@dataclass(frozen=True)
class Place:
    """The joint on which an effect is drawn.

    Attributes:
        i: index of the joint.
        plan: the robot.
        work: how hard its joints work.
        coulomb: Coulomb friction of the joint [Nm].
        rng: random numbers of the case.
    """

    i: int
    plan: Plan
    work: Workload
    coulomb: float
    rng: np.random.Generator

    def log_uniform(self, low: float, high: float) -> float:
        """A number whose logarithm is uniform."""
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def part(self, low: float, high: float) -> float:
        """That times the spread of the joint's torque [Nm]."""
        return self.log_uniform(low, high) * float(self.work.torque[self.i])

    def sign(self) -> float:
        """−1 or 1."""
        return float(self.rng.choice([-1.0, 1.0]))

    def phase(self) -> float:
        """An angle [rad]."""
        return float(self.rng.uniform(-pi, pi))


Values = dict[str, float]


def _coulomb(at: Place) -> Values:
    return {"coulomb": at.part(0.06, 0.55)}


def _presliding(at: Place) -> Values:
    coulomb = at.part(0.08, 0.4)
    return {"presliding_stiffness": coulomb / at.log_uniform(0.004, 0.03), "coulomb": coulomb}


def _stribeck(at: Place) -> Values:
    return {"stribeck": at.coulomb * float(at.rng.uniform(0.2, 0.95)), "velocity": at.log_uniform(0.03, 0.18)}


def _load_dependent(at: Place) -> Values:
    return {"coefficient": at.log_uniform(0.03, 0.15)}


def _quadratic(at: Place) -> Values:
    return {"quadratic": at.part(0.02, 0.2) / float(at.work.quadratic[at.i])}


def _offset(at: Place) -> Values:
    return {"offset": at.sign() * at.part(0.015, 0.15)}


def _ripple(at: Place) -> Values:
    return {"amplitude": at.part(0.015, 0.12), "order": float(at.rng.integers(4, 26)), "phase": at.phase()}


def _spring(at: Place) -> Values:
    rest = float(at.work.middle[at.i] + at.rng.uniform(-0.3, 0.3))
    distance = float(np.hypot(at.work.travel[at.i], at.work.middle[at.i] - rest))
    return {"stiffness": at.part(0.05, 0.35) / distance, "rest_angle": rest}


def _transmission_error(at: Place) -> Values:
    return {
        "amplitude": at.log_uniform(3e-5, 6e-4),
        "order": float(at.rng.integers(2, 13)),
        "phase": at.phase(),
    }


def _damping(at: Place) -> Values:
    """A loss factor of 0.5–5 % at the vibration of the motor on its spring."""
    stiffness, inertia = float(at.plan.model.stiffness[at.i]), float(at.plan.model.motor_inertia[at.i])
    return {"damping": at.log_uniform(0.005, 0.05) * (stiffness * inertia) ** 0.5}


def _hardening(at: Place) -> Values:
    """The spring is 5–60 % stiffer at three times the usual torque."""
    stiffness = float(at.plan.model.stiffness[at.i])
    deflection = 3.0 * float(at.work.torque[at.i]) / stiffness
    return {"cubic_stiffness": at.log_uniform(0.05, 0.6) * stiffness / deflection**2}


def _startup(at: Place) -> Values:
    return {"startup": at.coulomb * float(at.rng.uniform(0.25, 0.9)), "angle": at.log_uniform(0.008, 0.05)}


def _directional(at: Place) -> Values:
    model = at.plan.model
    viscous = float(model.link_viscous_friction[at.i] + model.motor_viscous_friction[at.i])
    return {"directional": at.sign() * viscous * float(at.rng.uniform(0.3, 0.8))}


def _thinning(at: Place) -> Values:
    speed = float(at.work.speed[at.i])
    velocity = at.log_uniform(0.05, 0.3) * speed
    return {"thinning": at.part(0.05, 0.2) / float(np.arcsinh(speed / velocity)), "velocity": velocity}


DRAWS: dict[str, Callable[[Place], Values]] = {
    "coulomb_friction": _coulomb,
    "link_coulomb_friction": _coulomb,
    "presliding_hysteresis": _presliding,
    "stribeck_friction": _stribeck,
    "load_dependent_friction": _load_dependent,
    "quadratic_friction": _quadratic,
    "torque_offset": _offset,
    "torque_ripple": _ripple,
    "cable_spring": _spring,
    "transmission_error": _transmission_error,
    "joint_damping": _damping,
    "stiffness_hardening": _hardening,
    "startup_friction": _startup,
    "directional_friction": _directional,
    "thinning_friction": _thinning,
}
"""Effect of the library → its random parameters."""
WEIGHTS = {
    "stribeck_friction": 3.0, "load_dependent_friction": 3.0, "torque_offset": 3.0, "torque_ripple": 2.5,
    "cable_spring": 2.0, "quadratic_friction": 1.0, "transmission_error": 0.6, "joint_damping": 0.4,
    "stiffness_hardening": 0.4,
}  # fmt: skip
"""Effects besides the friction that resists a start → how often they are drawn."""
NEEDS_COULOMB = ("stribeck_friction", "startup_friction")  # are only sought beside Coulomb friction


def draw_effects(robot: str, plan: Plan, work: Workload, rng: np.random.Generator) -> tuple[EffectValue, ...]:
    """The effects that a robot hides: friction on most joints, and others wherever they fall."""
    joints = plan.robot.joints
    number = int(rng.integers(NUMBERS[robot][0], NUMBERS[robot][1] + 1))
    chosen: dict[tuple[str, int], Values] = {}
    coulomb = np.zeros(len(joints))
    for i in range(len(joints)):
        name = str(rng.choice(list(FRICTIONS), p=list(FRICTIONS.values())))
        if name:
            values = DRAWS[name](Place(i, plan, work, 0.0, rng))
            chosen[name, i] = values
            coulomb[i] = values["coulomb"] if name == "coulomb_friction" else 0.0
    weights = np.array(list(WEIGHTS.values())) / sum(WEIGHTS.values())
    while len(chosen) < number:
        name, i = str(rng.choice(list(WEIGHTS), p=weights)), int(rng.integers(len(joints)))
        if (name, i) in chosen or (name in NEEDS_COULOMB and not coulomb[i]):
            continue
        chosen[name, i] = DRAWS[name](Place(i, plan, work, float(coulomb[i]), rng))
    return tuple(EffectValue(name, joints[i], values) for (name, i), values in chosen.items())


def draw_also(
    names: tuple[str, ...],
    hidden: tuple[EffectValue, ...],
    plan: Plan,
    work: Workload,
    rng: np.random.Generator,
) -> tuple[EffectValue, ...]:
    """Each named effect on one joint of a robot that hides others, where it is possible."""
    coulomb = {e.joint: e.parameters["coulomb"] for e in hidden if e.effect == "coulomb_friction"}
    out = []
    for name in names:
        taken = {e.joint for e in hidden if e.effect == name}
        free = [
            j for j in plan.robot.joints if j not in taken and (j in coulomb or name not in NEEDS_COULOMB)
        ]
        if free:
            joint = str(rng.choice(free))
            place = Place(plan.robot.joints.index(joint), plan, work, coulomb.get(joint, 0.0), rng)
            out.append(EffectValue(name, joint, DRAWS[name](place)))
    return tuple(out)
