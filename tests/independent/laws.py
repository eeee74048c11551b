"""What motors and joints do, and every effect that can be hidden, written from the equations alone.

    link    M(q) q̈ + C(q,q̇) q̇ + g(q) + f_l = τ_j + τ_ext
    motor   B θ̈ + f_m + τ_j = τ
    joint   x = deadzone(θ + a sin(nθ+φ) − q, b),   τ_j = K x + k₃ x³ + D ẋ

Vectors of joints have shape (runs · n,), run after run; sign(v) is tanh(v / 0.005 rad/s). The motor equation
keeps τ_j: the reaction of a transmission error on the motor is neglected.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from independent.arms import Array

CREEP = 0.005  # [rad/s]


@dataclass(frozen=True)
class Effect:
    """One hidden effect.

    Attributes:
        name: as in the table of effects, or one of `STRANGE`.
        joint: its number, None where it belongs to none.
        values: its parameters in SI units.
        payload: whose payload is misstated.
        run: number of the run in which a contact happens.
    """

    name: str
    joint: int | None
    values: Mapping[str, float]
    payload: str | None = None
    run: int | None = None


# Effects that no list has, and their parameters.
STRANGE = {
    "sticky_patch": ("peak", "position", "width"),  # f_m: peak · exp(−((θ−θ₀)/w)²) · sign(v)
    "one_way_drag": ("drag",),  # f_m: drag · max(v, 0)
    "bumper": ("stiffness", "position"),  # f_l: k · max(q − q₀, 0)
    "shaking": ("amplitude", "frequency"),  # f_m: a · sin(2π f t)
}


class Laws:
    """Springs, frictions and loads of all joints of all runs."""

    def __init__(
        self,
        runs: int,
        stiffness: Array,
        motor_inertia: Array,
        link_viscous: Array,
        motor_viscous: Array,
        effects: Sequence[Effect],
    ) -> None:
        """
        Args:
            runs: how many.
            stiffness: K, shape (n,) [Nm/rad].
            motor_inertia: B, shape (n,) [kg m²].
            link_viscous, motor_viscous: shape (n,) [Nm s/rad].
            effects: what else there is.
        """
        self.n = len(stiffness)
        self.stiffness, self.inertia = np.tile(stiffness, runs), np.tile(motor_inertia, runs)
        self.link_viscous, self.motor_viscous = np.tile(link_viscous, runs), np.tile(motor_viscous, runs)
        self.coulomb, self.link_coulomb = np.zeros(runs * self.n), np.zeros(runs * self.n)
        self.effects: dict[str, list[tuple[slice, Mapping[str, float]]]] = {}
        for e in effects:
            if e.joint is not None:
                where = slice(e.joint, None, self.n)
                self.effects.setdefault(e.name, []).append((where, e.values))
        for where, p in self.effects.pop("coulomb_friction", []):
            self.coulomb[where] += p["coulomb"]
        for where, p in self.effects.pop("link_coulomb_friction", []):
            self.link_coulomb[where] += p["coulomb"]
        bristles = self.effects.get("presliding_hysteresis", [])
        for where, _ in bristles:
            self.coulomb[where] = 0.0  # a bristle's friction stands for Coulomb's
        self.contacts = [
            (e.run * self.n + e.joint, e.values)
            for e in effects
            if e.name == "external_contact" and e.run is not None and e.joint is not None
        ]
        self.sliding, self.link_sliding = bool(self.coulomb.any()), bool(self.link_coulomb.any())
        self.bristles = bool(bristles)
        self.coupling: Array | None = None
        if "motor_coupling" in self.effects:
            matrix = np.diag(motor_inertia)
            for e in effects:
                if e.name == "motor_coupling" and e.joint is not None:
                    other = e.joint + 1 if e.joint + 1 < self.n else e.joint - 1
                    matrix[e.joint, other] += e.values["inertia"]
            self.coupling = np.kron(np.eye(runs), np.linalg.inv(matrix))

    def each(self, name: str) -> Sequence[tuple[slice, Mapping[str, float]]]:
        return self.effects.get(name, ())

    # -- joint ------------------------------------------------------------------------------------------

    def spring(self, theta: Array, v: Array, q: Array, q_velocity: Array) -> Array:
        """τ_j [Nm]."""
        x = theta - q
        for at, p in self.each("transmission_error"):
            x[at] += p["amplitude"] * np.sin(p["order"] * theta[at] + p["phase"])
        inside = []
        for at, p in self.each("backlash"):
            b = p["half_width"]
            inside.append((at, np.abs(x[at]) < b))
            x[at] -= np.clip(x[at], -b, b)
        torque = self.stiffness * x
        for at, p in self.each("stiffness_hardening"):
            torque[at] += p["cubic_stiffness"] * x[at] ** 3
        damped = self.each("joint_damping")
        if damped:
            rate = v - q_velocity
            for at, p in self.each("transmission_error"):
                rate[at] += p["amplitude"] * p["order"] * np.cos(p["order"] * theta[at] + p["phase"]) * v[at]
            for at, gap in inside:
                rate[at][gap] = 0.0
            for at, p in damped:
                torque[at] += p["damping"] * rate[at]
        return torque

    # -- motor ------------------------------------------------------------------------------------------

    def motor(self, t: float, theta: Array, v: Array, joint_torque: Array, z: Array) -> Array:
        """f_m [Nm]; t is the run's own time [s], z the bristles' deflection [rad]."""
        f = self.motor_viscous * v
        if self.sliding:
            f += self.coulomb * np.tanh(v / CREEP)
        for name, parts in self.effects.items():
            law = getattr(self, "_" + name, None)
            if law is not None:
                for at, p in parts:
                    f[at] += law(p, t, theta[at], v[at], joint_torque[at], at)
        for at, p in self.each("presliding_hysteresis"):
            f[at] += p["presliding_stiffness"] * z[at]
        return f

    def bristle_rate(self, v: Array, z: Array) -> Array:
        """ż [rad/s]; zero where a joint has no bristles."""
        rate = np.zeros_like(v)
        for at, p in self.each("presliding_hysteresis"):
            rate[at] = v[at] - np.abs(v[at]) * z[at] * (p["presliding_stiffness"] / p["coulomb"])
        return rate

    def motor_acceleration(self, torque: Array) -> Array:
        """θ̈ [rad/s²] from what is left of the motor's torque [Nm]."""
        return torque / self.inertia if self.coupling is None else self.coupling @ torque

    def _stribeck_friction(self, p, t, theta, v, joint_torque, at):
        return p["stribeck"] * np.exp(-((v / p["velocity"]) ** 2)) * np.tanh(v / CREEP)

    def _quadratic_friction(self, p, t, theta, v, joint_torque, at):
        return p["quadratic"] * v * np.abs(v)

    def _load_dependent_friction(self, p, t, theta, v, joint_torque, at):
        return p["coefficient"] * np.abs(joint_torque) * np.tanh(v / CREEP)

    def _driving_friction(self, p, t, theta, v, joint_torque, at):
        given, taken = np.maximum(joint_torque * np.sign(v), 0.0), np.maximum(-joint_torque * np.sign(v), 0.0)
        return (p["motor_driving"] * given + p["load_driving"] * taken) * np.tanh(v / CREEP)

    def _friction_drift(self, p, t, theta, v, joint_torque, at):
        cold = p["relative_rise"] * np.exp(-max(t, 0.0) / p["time_constant"])
        return self.motor_viscous[at] * v * cold

    def _torque_ripple(self, p, t, theta, v, joint_torque, at):
        return p["amplitude"] * np.sin(p["order"] * theta + p["phase"])

    def _torque_offset(self, p, t, theta, v, joint_torque, at):
        return p["offset"]

    def _sticky_patch(self, p, t, theta, v, joint_torque, at):
        return p["peak"] * np.exp(-(((theta - p["position"]) / p["width"]) ** 2)) * np.tanh(v / CREEP)

    def _one_way_drag(self, p, t, theta, v, joint_torque, at):
        return p["drag"] * np.maximum(v, 0.0)

    def _shaking(self, p, t, theta, v, joint_torque, at):
        return p["amplitude"] * np.sin(2 * np.pi * p["frequency"] * t)

    # -- link -------------------------------------------------------------------------------------------

    def link(self, q: Array, q_velocity: Array) -> Array:
        """f_l [Nm]."""
        f = self.link_viscous * q_velocity
        if self.link_sliding:
            f += self.link_coulomb * np.tanh(q_velocity / CREEP)
        for at, p in self.each("cable_spring"):
            f[at] += p["stiffness"] * (q[at] - p["rest_angle"])
        for at, p in self.each("bumper"):
            f[at] += p["stiffness"] * np.maximum(q[at] - p["position"], 0.0)
        return f

    def pushed(self, begin: float, end: float) -> Array | None:
        """τ_ext [Nm], the mean over an interval of the runs' time [s]; None without contacts."""
        if not self.contacts:
            return None
        out = np.zeros_like(self.stiffness)
        for at, p in self.contacts:
            during = min(end, p["end"]) - max(begin, p["start"])
            out[at] += p["torque"] * max(during, 0.0) / (end - begin)
        return out
