"""Integration step from the plant's fastest motion."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np

from flexviz.base.errors import InputError
from flexviz.model.simulation.plant import Array, Plant
from flexviz.robot._pinocchio import pin
from flexviz.robot.urdf_joints import unloaded

LARGEST_PHASE = 0.3  # [rad] of the fastest vibration per step
LARGEST_DECAY = 1.8  # [-] step times the fastest decay rate


@dataclass(frozen=True)
class FastestMotion:
    """The fastest vibration [rad/s] and the fastest decay [1/s] of a plant."""

    vibration: float
    decay: float

    @property
    def longest_step(self) -> float:
        """The longest integration step that resolves both [s]."""
        return min(LARGEST_PHASE / max(self.vibration, 1e-9), LARGEST_DECAY / max(self.decay, 1e-9))


def fastest(plant: Plant, positions: Array) -> FastestMotion:
    """The fastest motion of the plant around `positions` (M, n)."""
    n = plant.n
    data = plant.model.createData()
    inverse = np.linalg.inv(plant.motor_inertia)
    vibration = decay = 0.0
    for q in positions:
        load = pin.computeGeneralizedGravity(plant.model, data, q).copy()
        load = 3.0 * np.abs(load) + 1e-9
        mobility = pin.computeMinverse(plant.model, data, q)
        mobility = np.triu(mobility) + np.triu(mobility, 1).T
        if not np.isfinite(mobility).all():
            empty = unloaded(plant.model, plant.model.names[1:])
            raise InputError(f"nothing with mass moves with joint {', '.join(empty)}: lock it")
        k = np.array([plant.joint(i).tangent(float(load[i])) for i in range(n)])
        system = np.block([[mobility * k, -mobility * k], [-inverse * k, inverse * k]])
        vibration = max(vibration, float(np.sqrt(np.abs(np.linalg.eigvals(system)).max())))
        link, motor = plant.link_viscous.copy(), plant.motor_viscous.copy()
        for i, joint in plant.elastic.items():
            link[i] += joint.damping
            motor[i] += joint.damping
        e = 1e-5  # [rad/s]
        for i, law in plant.link_laws:
            link[i] += abs(law(0.0, q[i], e) - law(0.0, q[i], -e)) / (2 * e)
        for i, law in plant.motor_laws:
            motor[i] += abs(law(0.0, q[i], e, load[i]) - law(0.0, q[i], -e, load[i])) / (2 * e)
        for i, k, law in plant.coupled_laws:  # d (v_i + v_k)² ≤ 2 d v_i² + 2 d v_k²
            slope = abs(law(e, 0.0) - law(-e, 0.0)) / (2 * e)
            motor[i] += 2 * slope
            motor[k] += 2 * slope
        for sign in (1.0, -1.0) if plant.extra else ():
            y = plant.empty_state()
            y[: 2 * n], y[2 * n : 4 * n] = np.tile(q, 2), sign * e
            for i, _, pull in plant.pulls(0.0, y.tolist(), load):
                link[i] += sign * pull.link / (2 * e)
                motor[i] += sign * pull.motor / (2 * e)
        presliding = max((2.0 * d.presliding_stiffness / d.coulomb for _, d in plant.presliding), default=0.0)
        extra = np.zeros(n)
        for i, d in plant.presliding:
            extra[i] += d.presliding_stiffness
        vibration = max(vibration, float(np.sqrt(np.abs(np.diag(inverse) * (extra + k)).max())))
        decay = max(decay, _largest(mobility, link), _largest(inverse, motor), presliding)
    return FastestMotion(vibration, decay)


def substeps(plant: Plant, positions: Array, interval: float) -> int:
    """Number of integration steps in `interval` [s] that resolves the fastest motion."""
    motion = fastest(plant, positions)
    return max(
        1, ceil(interval * motion.vibration / LARGEST_PHASE), ceil(interval * motion.decay / LARGEST_DECAY)
    )


def _largest(inverse: Array, damping: Array) -> float:
    return float(np.abs(np.linalg.eigvals(inverse * damping)).max())
