"""The elastic joint's law solved for its deflection: τ_j = K x + k₃ x³ + D ẋ.

Without damping it is local in time and has a closed form, x = h(τ_j). Damping is a low-pass filter with time
constant D/K: with w = K x + k₃ x³ the law is w + D d/dt h(w) = τ_j, and h(w) = w/K̄ up to a small remainder.

The contributions of hardening and damping do not add up exactly: the difference between their joint
contribution and the sum of both is divided equally, at the current values of both.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexviz.model.effects.terms import Array, JointMotion

CONVERGED_CHANGE = 1e-7  # of the largest deflection, at which the iteration ends
MAX_ITERATIONS = 60


class DampedSpring:
    """The deflection of a hardening, damped spring over time.

    Args:
        torque: shape (N,), joint torque [Nm]; mirrored at its ends.
        step: between samples [s].
        stiffness, cubic, damping: K [Nm/rad], k₃ [Nm/rad³] ≥ 0, D [Nm s/rad] ≥ 0.
    """

    def __init__(self, torque: Array, step: float, stiffness: float, cubic: float, damping: float) -> None:
        self._count, self._damping = len(torque), damping
        whole = np.concatenate((torque, torque[::-1]))
        self._iw = 2j * np.pi * np.fft.rfftfreq(len(whole), step)
        self._iw[-1] = 0.0  # the highest frequency has no sign
        self._x = hardened(whole, stiffness, cubic)
        self._tangent = self._stiffness_at(stiffness, cubic)
        if damping:
            self._x = self._damped(whole, lambda w: hardened(w, stiffness, cubic))
            self._tangent = self._stiffness_at(stiffness, cubic)

    @property
    def deflection(self) -> Array:
        """x, shape (N,) [rad]."""
        return self._x[: self._count]

    def slope_by_cubic(self) -> Array:
        """∂x/∂k₃, shape (N,)."""
        return self._linear(-self._x * np.square(self._x))

    def slope_by_damping(self) -> Array:
        """∂x/∂D, shape (N,)."""
        return self._linear(-np.fft.irfft(np.fft.rfft(self._x) * self._iw, len(self._x)))

    def _stiffness_at(self, stiffness: float, cubic: float) -> Array:
        return stiffness + 3 * cubic * np.square(self._x)

    def _linear(self, right: Array) -> Array:
        """δ of tangent(t) δ + D δ̇ = right, shape (N,)."""
        whole = self._damped(right, lambda w: w / self._tangent) if self._damping else right / self._tangent
        return whole[: self._count]

    def _damped(self, right: Array, spring: Callable[[Array], Array]) -> Array:
        """x = h(w) with w + D ẋ = right; `spring` is h, and the tangent about 1/h′."""
        size = len(right)
        middle = 2.0 / (1.0 / float(self._tangent.min()) + 1.0 / float(self._tangent.max()))
        lag = self._damping * self._iw
        response, wanted = 1.0 / (1.0 + lag / middle), np.fft.rfft(right)
        w = np.fft.irfft(wanted * response, size)
        x = spring(w)
        for _ in range(MAX_ITERATIONS):
            # (1 + D/K̄ d/dt) w_new = right − D d/dt (x − w/K̄)
            w = np.fft.irfft((wanted - lag * np.fft.rfft(x - w / middle)) * response, size)
            before, x = x, spring(w)
            if np.max(np.abs(x - before)) <= CONVERGED_CHANGE * np.max(np.abs(x)):
                break
        return x


def hardened(torque: Array, stiffness: float, cubic: float) -> Array:
    """x of K x + k₃ x³ = τ, by the hyperbolic form of Cardano's formula."""
    most = np.max(np.abs(torque), initial=0.0)
    if cubic * most**2 <= 1e-12 * stiffness**3:
        return torque / stiffness  # hardening below any rounding
    scale = np.sqrt(4 * stiffness / (3 * cubic))
    return scale * np.sinh(np.arcsinh(3 * torque / (stiffness * scale)) / 3)


def spring_at(motion: JointMotion, cubic: float, damping: float) -> DampedSpring:
    """The joint's spring under the torque of a motion; negative coefficients count as zero."""
    return DampedSpring(
        motion.torque, motion.step, motion.stiffness, max(float(cubic), 0.0), max(float(damping), 0.0)
    )


def gain(motion: JointMotion, spring: DampedSpring) -> Array:
    """Increase of q over that with the linear spring, shape (N,) [rad]."""
    return motion.torque / motion.stiffness - spring.deflection


def present(motion: JointMotion, effect: str) -> float:
    """The current size of one of the joint's effects; 0 if it has none."""
    return max(motion.present.get(effect, (0.0,))[0], 0.0)


def share_of(effect: str, motion: JointMotion) -> Array | float:
    """The part of the joint gain of hardening and damping attributed to `effect`, one of the two [rad]."""
    if not present(motion, effect):
        return 0.0
    if effect not in motion.notes:
        cubic, damping = present(motion, "stiffness_hardening"), present(motion, "joint_damping")
        together, hardening, damped = (
            gain(motion, spring_at(motion, *both))
            for both in ((cubic, damping), (cubic, 0.0), (0.0, damping))
        )
        motion.notes["joint_damping"] = 0.5 * (together + damped - hardening)
        motion.notes["stiffness_hardening"] = 0.5 * (together + hardening - damped)
    return motion.notes[effect]
