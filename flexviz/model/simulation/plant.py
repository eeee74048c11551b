"""The simulated flexible-joint robot: parameters, laws and joint torque.

Arrays are in Pinocchio's joint order. The state is x = [q, θ, q̇, θ̇, z] with the states z of extra laws.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from flexviz.model.effects import JointState
from flexviz.model.simulation.laws import CoupledLaw, Dahl, ElasticJoint, ExtraLaw, LinkLaw, MotorLaw, Pull

Array = np.ndarray


@dataclass
class Plant:
    """A robot with its parameters and effects, ready to be integrated (n joints, Pinocchio's order)."""

    model: Any  # Pinocchio model with the link-side inertias, payload and gravity
    # stiffness, link_viscous, motor_viscous: (n,)
    stiffness: Array
    motor_inertia: Array  # (n, n) [kg m²], diagonal unless motors couple
    link_viscous: Array
    motor_viscous: Array
    # motor_laws, link_laws: (joint index, law)
    motor_laws: list[tuple[int, MotorLaw]] = field(default_factory=list)
    link_laws: list[tuple[int, LinkLaw]] = field(default_factory=list)
    # (joint index, other joint's index, law), zero at rest
    coupled_laws: list[tuple[int, int, CoupledLaw]] = field(default_factory=list)
    # joint index -> law, for joints other than linear springs
    elastic: dict[int, ElasticJoint] = field(default_factory=dict)
    # (joint index, torque [Nm], start [s], end [s])
    contacts: list[tuple[int, float, float, float]] = field(default_factory=list)
    # (joint index, law): with own states, user-defined, or unmodelled
    extra: list[tuple[int, ExtraLaw]] = field(default_factory=list)

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.stiffness)

    @property
    def presliding(self) -> list[tuple[int, Dahl]]:
        """Those of the extra laws that are Dahl's."""
        return [(i, law) for i, law in self.extra if isinstance(law, Dahl)]

    def joint(self, i: int) -> ElasticJoint:
        """The elastic law of joint i."""
        return self.elastic.get(i) or ElasticJoint(float(self.stiffness[i]))

    def empty_state(self) -> Array:
        """A state vector (4n + own states) of zeros."""
        return np.zeros(4 * self.n + sum(law.states for _, law in self.extra))

    def pulls(
        self, time: float, y: list[float], carried: Sequence[float] | Array
    ) -> list[tuple[int, int, Pull]]:
        """Joint, index of its states, and torques of each extra law at the state `y` (4n + …).

        `carried` (n,) is the joint torque by the library's laws [Nm].
        """
        n, at, out = self.n, 4 * self.n, []
        for i, law in self.extra:
            z = y[at : at + law.states]
            state = JointState(time, y[n + i], y[3 * n + i], y[i], y[2 * n + i], float(carried[i]), z)
            out.append((i, at, law.pull(state)))
            at += law.states
        return out

    def joint_torque(self, x: Array, time: Array) -> Array:
        """τ_j (N, n) [Nm] for states x (N, 4n + …) at `time` (N,) [s]."""
        n = self.n
        q, theta, qv, thetav = (x[:, i * n : (i + 1) * n] for i in range(4))
        torque = self.stiffness * (theta - q)
        for i, law in self.elastic.items():
            columns = (theta[:, i].tolist(), q[:, i].tolist(), thetav[:, i].tolist(), qv[:, i].tolist())
            torque[:, i] = [law.torque(*row) for row in zip(*columns, strict=True)]
        if self.extra:
            rows = zip(time.tolist(), x.tolist(), torque.tolist(), strict=True)
            for k, row in enumerate(rows):
                for i, _, pull in self.pulls(*row):
                    torque[k, i] += pull.joint
        return torque
