"""Forward dynamics of the flexible-joint robot, both sides, by the articulated-body algorithm.

    link    q̈ = ABA(q, q̇, τ_j + τ_ext − f_l)
    motor   θ̈ = B⁻¹ (τ − f_m − τ_j)
    joint   τ_j = K (θ − q)   or ElasticJoint

Everything here is in Pinocchio's joint order. The state is x = [q, θ, q̇, θ̇, z], z the presliding
states and those of laws of one's own.
The integrator is the classical Runge–Kutta method of order 4 with the motor torque held over a call.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from flexviz._pinocchio import pin
from flexviz.simulation.elastic import ElasticJoint
from flexviz.simulation.extra_laws import ExtraLaw, JointState, Pull
from flexviz.simulation.laws import Dahl, LinkLaw, MotorLaw

Array = np.ndarray
Advance = Callable[[Array, float, float, int], None]


@dataclass
class Plant:
    """A robot with its parameters and effects, ready to be integrated (n joints, Pinocchio's order).

    Attributes
    ----------
    model: Pinocchio model with the link-side inertias, payload and gravity.
    stiffness, link_viscous, motor_viscous: (n,).
    motor_inertia: (n, n) [kg m²], diagonal unless motors couple.
    motor_laws, link_laws: (joint index, law).
    presliding: (joint index, Dahl).
    elastic: joint index -> law, for joints that are not a plain spring.
    contacts: (joint index, torque [Nm], start [s], end [s]).
    extra: (joint index, law) beside the library's.
    """

    model: Any
    stiffness: Array
    motor_inertia: Array
    link_viscous: Array
    motor_viscous: Array
    motor_laws: list[tuple[int, MotorLaw]] = field(default_factory=list)
    link_laws: list[tuple[int, LinkLaw]] = field(default_factory=list)
    presliding: list[tuple[int, Dahl]] = field(default_factory=list)
    elastic: dict[int, ElasticJoint] = field(default_factory=dict)
    contacts: list[tuple[int, float, float, float]] = field(default_factory=list)
    extra: list[tuple[int, ExtraLaw]] = field(default_factory=list)

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.stiffness)

    def joint(self, i: int) -> ElasticJoint:
        """The elastic law of joint i."""
        return self.elastic.get(i) or ElasticJoint(float(self.stiffness[i]))

    def empty_state(self) -> Array:
        """A state vector (4n + presliding and own states) of zeros."""
        return np.zeros(4 * self.n + len(self.presliding) + sum(law.states for _, law in self.extra))

    def pulls(
        self, time: float, y: list[float], carried: Sequence[float] | Array
    ) -> list[tuple[int, int, Pull]]:
        """Joint, place of its states and torques of each law of one's own, at the state `y` (4n + …).

        `carried` (n,) is what the joints carry by the library's laws [Nm].
        """
        n, out = self.n, []
        at = 4 * n + len(self.presliding)
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

    def stepper(self, x: Array) -> Advance:
        """A function advance(τ (n,), t, duration, substeps) that integrates the state `x` in place."""
        n = self.n
        size = len(self.empty_state())
        model, data, aba = self.model, self.model.createData(), pin.aba
        linear = self._linear_part()
        inverse: Array = np.linalg.inv(self.motor_inertia)
        diagonal = np.count_nonzero(self.motor_inertia - np.diag(np.diag(self.motor_inertia))) == 0
        apply = np.multiply if diagonal else np.dot
        weight = np.ascontiguousarray(np.diag(inverse)) if diagonal else inverse
        motor_laws, link_laws, presliding = self.motor_laws, self.link_laws, list(enumerate(self.presliding))
        elastic, contacts, own = list(self.elastic.items()), self.contacts, self.extra
        nonlinear = bool(motor_laws or link_laws or presliding or elastic or contacts or own)

        force = np.zeros(3 * n)  # link torque, motor torque, joint torque [Nm]
        link, motor, carried = force[:n], force[n : 2 * n], force[2 * n :]
        external = np.zeros(n)
        stage, scratch, slopes = np.zeros(size), np.zeros(size), np.zeros((4, size))
        weights = np.array([1.0, 2.0, 2.0, 1.0]) / 6.0

        def views(y: Array) -> tuple[Array, Array, Array, Array]:
            return y[: 4 * n], y[:n], y[2 * n : 3 * n], y[2 * n : 4 * n]

        def add_laws(t: float, y: Array, rate: Array) -> None:
            values = y.tolist()
            for i, law in elastic:
                torque = law.torque(values[n + i], values[i], values[3 * n + i], values[2 * n + i])
                carried[i] = torque
                link[i] += torque
                motor[i] -= torque
            if own:
                for i, at, pull in self.pulls(t, values, carried):
                    carried[i] += pull.joint
                    link[i] += pull.joint - pull.link
                    motor[i] -= pull.joint + pull.motor
                    rate[at : at + len(pull.rates)] = pull.rates
            for i, law in link_laws:
                link[i] -= law(t, values[i], values[2 * n + i])
            for i, law in motor_laws:
                motor[i] -= law(t, values[n + i], values[3 * n + i], carried[i])
            for k, (i, law) in presliding:
                z, velocity = values[4 * n + k], values[3 * n + i]
                motor[i] -= law.torque(z)
                rate[4 * n + k] = law.rate(z, velocity)
            if contacts:
                np.add(link, external, out=link)

        state_views, stage_views = views(x), views(stage)
        rates = [(k, k[: 2 * n], k[2 * n : 3 * n], k[3 * n : 4 * n]) for k in slopes]
        add, multiply, dot = np.add, np.multiply, np.dot

        def derivative(
            y: Array, parts: tuple[Array, ...], out: tuple[Array, ...], tau: Array, t: float
        ) -> None:
            four, q, qv, velocities = parts
            rate, positions, link_acceleration, motor_acceleration = out
            positions[:] = velocities
            dot(linear, four, out=force)
            if nonlinear:
                add_laws(t, y, rate)
            link_acceleration[:] = aba(model, data, q, qv, link)
            add(motor, tau, out=motor)
            apply(weight, motor, out=motor_acceleration)

        def advance(tau: Array, t: float, duration: float, substeps: int) -> None:
            h = duration / substeps
            half = 0.5 * h
            for s in range(substeps):
                now = t + s * h
                if contacts:
                    external[:] = 0.0
                    for i, torque, start, end in contacts:
                        overlap = min(end, now + h) - max(start, now)
                        if overlap > 0.0:
                            external[i] += torque * overlap / h
                derivative(x, state_views, rates[0], tau, now)
                multiply(slopes[0], half, out=scratch)
                add(x, scratch, out=stage)
                derivative(stage, stage_views, rates[1], tau, now + half)
                multiply(slopes[1], half, out=scratch)
                add(x, scratch, out=stage)
                derivative(stage, stage_views, rates[2], tau, now + half)
                multiply(slopes[2], h, out=scratch)
                add(x, scratch, out=stage)
                derivative(stage, stage_views, rates[3], tau, now + h)
                dot(weights, slopes, out=scratch)
                multiply(scratch, h, out=scratch)
                add(x, scratch, out=x)

        return advance

    def _linear_part(self) -> Array:
        """(3n, 4n): x -> [τ_j − f_lv q̇, −τ_j − f_mv θ̇, τ_j], without joints that have their own law."""
        n = self.n
        spring = self.stiffness.copy()
        spring[list(self.elastic)] = 0.0
        matrix = np.zeros((3, n, 4, n))
        i = np.arange(n)
        for row, sign in ((0, 1.0), (1, -1.0), (2, 1.0)):
            matrix[row, i, 0, i] = -sign * spring
            matrix[row, i, 1, i] = sign * spring
        matrix[0, i, 2, i] = -self.link_viscous
        matrix[1, i, 3, i] = -self.motor_viscous
        return matrix.reshape(3 * n, 4 * n)
