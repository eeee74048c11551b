"""Which effects and laws a robot hides, and how large they are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.diagnosis_study.laws import OFTEN, Place
from benchmarks.diagnosis_study.motions import Workload
from flexviz.model.simulation import ExtraLaw, Plan
from flexviz.robot.model import EffectValue

NUMBERS = {"2r": (3, 10), "ur5": (7, 15), "panda": (8, 15)}
"""Robot → smallest and largest number of effects of the library, Coulomb friction included."""
FRICTIONS = {"coulomb_friction": 0.85, "link_coulomb_friction": 0.05, "presliding_hysteresis": 0.06, "": 0.04}
"""What resists the start of a joint → its probability; "" for nothing."""
LAWS = (0.5, 0.35, 0.15)  # probability of none, one, two laws that the library does not have


@dataclass(frozen=True)
class Worked(Place):
    """A place with how hard the joints work, and Coulomb friction of this one [Nm]."""

    work: Workload
    coulomb: float


Values = dict[str, float]


def _presliding(at: Worked) -> Values:
    coulomb = at.part(0.08, 0.4)
    return {"presliding_stiffness": coulomb / at.log_uniform(0.004, 0.03), "coulomb": coulomb}


def _spring(at: Worked) -> Values:
    rest = float(at.work.middle[at.i]) + at.uniform(-0.3, 0.3)
    distance = float(np.hypot(at.work.travel[at.i], at.work.middle[at.i] - rest))
    return {"stiffness": at.part(0.05, 0.35) / distance, "rest_angle": rest}


def _hardening(at: Worked) -> Values:
    """The spring is 5–60 % stiffer at three times the usual torque."""
    deflection = 3.0 * at.torque / at.stiffness
    return {"cubic_stiffness": at.log_uniform(0.05, 0.6) * at.stiffness / deflection**2}


def _directional(at: Worked) -> Values:
    model = at.plan.model
    viscous = float(model.link_viscous_friction[at.i] + model.motor_viscous_friction[at.i])
    return {"directional": at.sign() * viscous * at.uniform(0.3, 0.8)}


def _thinning(at: Worked) -> Values:
    speed = float(at.work.speed[at.i])
    velocity = at.log_uniform(0.05, 0.3) * speed
    return {"thinning": at.part(0.05, 0.2) / float(np.arcsinh(speed / velocity)), "velocity": velocity}


DRAWS: dict[str, Callable[[Worked], Values]] = {
    "coulomb_friction": lambda at: {"coulomb": at.part(0.06, 0.55)},
    "link_coulomb_friction": lambda at: {"coulomb": at.part(0.06, 0.55)},
    "presliding_hysteresis": _presliding,
    "stribeck_friction": lambda at: {
        "stribeck": at.coulomb * at.uniform(0.2, 0.95), "velocity": at.log_uniform(0.03, 0.18)
    },
    "load_dependent_friction": lambda at: {"coefficient": at.log_uniform(0.03, 0.15)},
    "quadratic_friction": lambda at: {"quadratic": at.part(0.02, 0.2) / float(at.work.quadratic[at.i])},
    "torque_offset": lambda at: {"offset": at.sign() * at.part(0.015, 0.15)},
    "torque_ripple": lambda at: {
        "amplitude": at.part(0.015, 0.12), "order": at.whole(4, 26), "phase": at.phase()
    },
    "cable_spring": _spring,
    "transmission_error": lambda at: {
        "amplitude": at.log_uniform(3e-5, 6e-4), "order": at.whole(2, 13), "phase": at.phase()
    },
    # a loss factor of 0.5–5 % at the vibration of the motor on its spring
    "joint_damping": lambda at: {
        "damping": at.log_uniform(0.005, 0.05) * (at.stiffness * at.motor_inertia) ** 0.5
    },
    "stiffness_hardening": _hardening,
    "startup_friction": lambda at: {
        "startup": at.coulomb * at.uniform(0.25, 0.9), "angle": at.log_uniform(0.008, 0.05)
    },
    "directional_friction": _directional,
    "thinning_friction": _thinning,
}  # fmt: skip
"""Effect of the library → its random parameters, drawn in the order in which they stand."""
WEIGHTS = {
    "stribeck_friction": 3.0, "load_dependent_friction": 3.0, "torque_offset": 3.0, "torque_ripple": 2.5,
    "cable_spring": 2.0, "quadratic_friction": 1.0, "transmission_error": 0.6, "joint_damping": 0.4,
    "stiffness_hardening": 0.4,
}  # fmt: skip
"""Effects besides the friction that resists a start → how often they are drawn."""
NEEDS_COULOMB = ("stribeck_friction", "startup_friction")  # are only sought given Coulomb friction


def place(plan: Plan, work: Workload, i: int, rng: np.random.Generator, coulomb: float = 0.0) -> Worked:
    """Joint i of a plan whose effects are not chosen yet."""
    inside = float(work.low[i]), float(work.high[i])
    return Worked(plan, i, float(work.torque[i]), inside, rng, work, coulomb)


def draw_effects(robot: str, plan: Plan, work: Workload, rng: np.random.Generator) -> tuple[EffectValue, ...]:
    """The effects that a robot hides: friction on most joints, and others wherever they fall."""
    joints = plan.robot.joints
    number = int(rng.integers(NUMBERS[robot][0], NUMBERS[robot][1] + 1))
    chosen: dict[tuple[str, int], Values] = {}
    coulomb = np.zeros(len(joints))
    for i in range(len(joints)):
        name = str(rng.choice(list(FRICTIONS), p=list(FRICTIONS.values())))
        if name:
            values = chosen[name, i] = DRAWS[name](place(plan, work, i, rng))
            coulomb[i] = values["coulomb"] if name == "coulomb_friction" else 0.0
    weights = np.array(list(WEIGHTS.values())) / sum(WEIGHTS.values())
    while len(chosen) < number:
        name, i = str(rng.choice(list(WEIGHTS), p=weights)), int(rng.integers(len(joints)))
        if (name, i) in chosen or (name in NEEDS_COULOMB and not coulomb[i]):
            continue
        chosen[name, i] = DRAWS[name](place(plan, work, i, rng, float(coulomb[i])))
    return tuple(EffectValue(name, joints[i], values) for (name, i), values in chosen.items())


def draw_also(
    names: tuple[str, ...],
    hidden: tuple[EffectValue, ...],
    plan: Plan,
    work: Workload,
    rng: np.random.Generator,
) -> tuple[EffectValue, ...]:
    """Each named effect on one joint of a robot that hides others, where it is possible."""
    joints, out = plan.robot.joints, []
    coulomb = {e.joint: e.parameters["coulomb"] for e in hidden if e.effect == "coulomb_friction"}
    for name in names:
        taken = {e.joint for e in hidden if e.effect == name}
        free = [j for j in joints if j not in taken and (j in coulomb or name not in NEEDS_COULOMB)]
        if free:
            joint = str(rng.choice(free))
            at = place(plan, work, joints.index(joint), rng, coulomb.get(joint, 0.0))
            out.append(EffectValue(name, joint, DRAWS[name](at)))
    return tuple(out)


def draw_laws(plan: Plan, work: Workload, rng: np.random.Generator) -> list[tuple[str, str, ExtraLaw]]:
    """Kind, joint and law of what the library does not have, on different joints."""
    number, out = int(rng.choice(len(LAWS), p=LAWS)), []
    for i in rng.permutation(plan.robot.n)[:number].tolist():
        kind = str(rng.choice(list(OFTEN), p=[chance for chance, _ in OFTEN.values()]))
        out.append((kind, plan.robot.joints[i], OFTEN[kind][1](place(plan, work, i, rng))))
    return out
