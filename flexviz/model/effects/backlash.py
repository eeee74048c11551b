"""Backlash."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from flexviz.base.arrays import Bools
from flexviz.model.effects.effect import HiddenStart, JointScale
from flexviz.model.effects.law import LawEffect
from flexviz.model.effects.terms import Array, JointMotion, ParameterSpec

# A torque below IDLE_SHARE of the largest one within RINGING_TIME (an observer rings after the torque falls
# to zero), plus FAINT_SHARE of the rms, may be that of a joint inside the gap; one above LOADED_SHARE presses
# on a flank. For simulated gaps of 13 joints, other values explain less at the true parameters.
IDLE_SHARE, LOADED_SHARE, RINGING_TIME, FAINT_SHARE = 0.06, 0.12, 0.06, 0.01  # [], [], [s], []
START_SHARES = (0.1, 0.3, 0.7)  # of the rms deflection: initial gaps of a search
# Smallest share of the compliance that a start keeps with a gap. Verdicts and values of three two-joint
# sets (backlash, hardening, ripple) agree to 1e-9 for 0.1, 0.2 and 0.4.
LEAST_COMPLIANCE = 0.2


class Backlash(LawEffect):
    name = "backlash"
    title = "Backlash"
    where = "joint"
    plot_against = "torque"
    explanation = (
        "Play between gear teeth: when the load changes sign, the motor moves briefly without the link."
    )
    equation = "τ_j = K · deadzone(δ, b)"
    signature = "A position step of 2b whenever the transmitted torque changes sign."
    confirm = "Slow motion through the pose of zero load."
    reference = (
        "Nordin, Gutman: Controlling mechanical systems with backlash — a survey, Automatica 38(10), 2002"
    )
    parameters = (ParameterSpec("half_width", "rad", 0.0, 0.2, "half the play", "b"),)
    state = True
    linear = True
    abrupt = True

    def law(self, motion: JointMotion, values: Array) -> tuple[Array, Array]:
        # the way across is that of the present b, like the torque: u stays linear
        flank = _flank(motion, abs(motion.present.get(self.name, (0.0,))[0]))
        return -values[0] * flank, -flank[None]

    def undecided(self, motion: JointMotion, values: Array) -> tuple[Bools, Array]:
        idle = ~_above(IDLE_SHARE, motion)
        return idle, np.full(len(idle), 2 * abs(float(values[0])))

    def hidden_starts(self, torque: Array, compliance: float, rough: float) -> list[HiddenStart]:
        """Several gaps b, each with b E|s| / E s² less compliance; the last ends at the rough one."""
        lever = float(np.mean(np.abs(torque)) / np.mean(torque**2))
        sizes = [share * compliance * float(np.sqrt(np.mean(torque**2))) for share in START_SHARES]
        sizes.append((compliance - rough) / lever)
        return [
            HiddenStart((size,), max(compliance - size * lever, LEAST_COMPLIANCE * compliance))
            for size in sizes
            if size > 0
        ]

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (max(0.15 * scale.deflection, 2e-4),)


def _above(share: float, motion: JointMotion) -> Bools:
    """Samples whose torque exceeds this share of the largest one near by, shape (N,)."""
    size = np.abs(motion.torque)
    reach = round(RINGING_TIME / motion.step)
    around = sliding_window_view(np.pad(size, reach, mode="edge"), 2 * reach + 1).max(axis=1)
    return np.asarray(size > np.maximum(share * around + FAINT_SHARE * motion.torque_scale, 1e-9))


def _flank(motion: JointMotion, half_width: float) -> Array:
    """Position in a gap of this half-width b from flank to flank, −1 … 1, shape (N,).

    The joint leaves a flank at the rate at which its spring has unwound, ṡ/K, and reaches the other one after
    the time T without torque. In between, motor and link move freely, at a nearly constant relative
    acceleration: the part ṡ/K · T of the way 2b is covered at constant speed, the rest as the square of time.
    """
    time, torque, step = motion.time, motion.torque, motion.step
    loaded = np.flatnonzero(_above(LOADED_SHARE, motion))
    if not loaded.size:
        return np.zeros(len(time))
    sign = np.sign(torque[loaded])
    through = np.flatnonzero(sign[1:] != sign[:-1])
    if not through.size:
        return np.full(len(time), sign[0])
    before, end = loaded[through], time[loaded[through + 1]]
    rate = (torque[before] - torque[np.maximum(before - 1, 0)]) / step
    falling = rate * torque[before] < 0
    left = np.divide(torque[before], -rate, out=np.zeros(len(rate)), where=falling)  # until it is zero [s]
    begin = np.minimum(time[before] + left, end - 2 * step)
    length = end - begin
    steady = np.minimum(np.abs(rate) / motion.stiffness * length / max(2 * half_width, 1e-12), 1.0)
    crossed = np.searchsorted(end, time, side="right")  # gaps that are behind each sample
    gap = np.minimum(crossed, len(end) - 1)
    part = np.where(crossed < len(end), np.clip((time - begin[gap]) / length[gap], 0.0, 1.0), 0.0)
    way = steady[gap] * part + (1 - steady[gap]) * part**2
    return np.asarray(sign[0] * (-1.0) ** crossed * (1 - 2 * way))
