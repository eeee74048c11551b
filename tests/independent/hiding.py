"""Every effect in a size that goes with what its joint does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from independent.laws import STRANGE, Effect
from independent.robots import FIT_RUNS, Work
from independent.simulator import Setup

KINDS = (
    "coulomb_friction", "stribeck_friction", "quadratic_friction", "load_dependent_friction",
    "presliding_hysteresis", "friction_drift", "torque_ripple", "torque_offset", "torque_gain",
    "torque_delay", "stiffness_hardening", "backlash", "joint_damping", "transmission_error",
    "link_coulomb_friction", "cable_spring", "payload_error", "base_tilt", "external_contact",
    "motor_coupling",
)  # fmt: skip


def effect_of(
    kind: str,
    j: int,
    setup: Setup,
    work: Work,
    known: Sequence[Effect],
    rng: np.random.Generator,
    size: float,
) -> Effect:
    """An effect in proportion to what its joint does."""
    torque, speed = float(work.torque[j]), float(work.speed[j])
    stiffness, bend = float(setup.stiffness[j]), float(work.peak[j] / setup.stiffness[j])

    def between(low: float, high: float) -> float:
        return float(rng.uniform(low, high)) * size

    def plain(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    sign = float(rng.choice([-1.0, 1.0]))
    phase = plain(-np.pi, np.pi)
    middle = float(work.middle[j] + work.range[j] * plain(-0.4, 0.4))
    values: Mapping[str, float]
    match kind:
        case "coulomb_friction" | "link_coulomb_friction":
            values = {"coulomb": between(0.03, 0.1) * torque}
        case "stribeck_friction":
            values = {"stribeck": between(0.05, 0.12) * torque, "velocity": plain(0.25, 0.6) * speed}
        case "quadratic_friction":
            values = {"quadratic": between(0.05, 0.12) * torque / speed**2}
        case "load_dependent_friction":
            values = {"coefficient": between(0.04, 0.1)}
        case "driving_friction":
            ratio = plain(1.5, 3.0) ** sign
            mean = between(0.04, 0.1)
            values = {
                "motor_driving": 2 * mean / (1 + ratio),
                "load_driving": 2 * mean * ratio / (1 + ratio),
            }
        case "presliding_hysteresis":
            own = next(e.values["coulomb"] for e in known if e.joint == j)
            coulomb = size * 2 * own
            values = {"presliding_stiffness": coulomb / plain(0.02, 0.08), "coulomb": coulomb}
        case "friction_drift":
            values = {"relative_rise": between(0.6, 1.5), "time_constant": plain(2.0, 6.0)}
        case "torque_ripple":
            values = {
                "amplitude": between(0.03, 0.1) * torque,
                "order": float(rng.integers(4, 31)),
                "phase": phase,
            }
        case "torque_offset":
            values = {"offset": sign * between(0.05, 0.15) * torque}
        case "torque_gain":
            values = {"gain_error": sign * between(0.05, 0.15)}
        case "torque_delay":
            return Effect(kind, None, {"delay": between(0.0008, 0.0025)})
        case "stiffness_hardening":
            values = {"cubic_stiffness": between(0.1, 0.4) * stiffness / bend**2}
        case "backlash":
            values = {"half_width": between(0.05, 0.2) * bend}
        case "joint_damping":
            values = {"damping": between(0.002, 0.007) * stiffness}
        case "transmission_error":
            order = float(rng.integers(1, 9))
            values = {"amplitude": between(0.05, 0.15) * bend, "order": order, "phase": phase}
        case "cable_spring":
            values = {"stiffness": between(0.05, 0.15) * torque / float(work.range[j]),
                      "rest_angle": plain(-0.5, 0.5)}  # fmt: skip
        case "payload_error":
            return Effect(
                kind, None, {"relative_mass_error": sign * between(0.1, 0.25)}, str(rng.choice(["p2", "p3"]))
            )
        case "base_tilt":
            planar = setup.n == 2
            return Effect(kind, None, {"tilt_x": 0.0 if planar else between(-0.06, 0.06),
                                       "tilt_y": sign * between(0.03, 0.08)})  # fmt: skip
        case "external_contact":
            start = plain(0.2, 0.6) * setup.duration
            values = {
                "torque": sign * between(0.05, 0.15) * torque,
                "start": start,
                "end": start + plain(0.6, 1.5),
            }
            return Effect(kind, j, values, run=int(rng.integers(FIT_RUNS)))
        case "motor_coupling":
            other = j + 1 if j + 1 < setup.n else j - 1
            values = {"inertia": sign * between(0.1, 0.3) * float(min(setup.motor_inertia[[j, other]]))}
        case "sticky_patch":
            values = {"peak": between(0.15, 0.35) * torque, "position": middle,
                      "width": plain(0.15, 0.3) * float(work.range[j])}  # fmt: skip
        case "one_way_drag":
            values = {"drag": between(0.08, 0.2) * torque / speed}
        case "bumper":
            values = {"stiffness": between(0.4, 1.0) * torque / float(work.range[j]), "position": middle}
        case "shaking":
            values = {"amplitude": between(0.08, 0.2) * torque, "frequency": plain(1.5, 3.5)}
        case _:
            raise ValueError(f'no case "{kind}"; there are {(*KINDS, *STRANGE)}')
    return Effect(kind, j, values)
