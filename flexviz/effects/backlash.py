"""Backlash."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexviz.effects.effect import EffectEvidence, HiddenStart, JointScale
from flexviz.effects.law import LawEffect
from flexviz.effects.terms import Array, JointMotion, ParameterSpec

# A joint may be inside the gap while its torque is below RINGING_SHARE of its maximum within RINGING_TIME
# (the observer rings after the torque falls to zero) plus FAINT_SHARE of its rms.
RINGING_SHARE, RINGING_TIME, FAINT_SHARE = 0.06, 0.08, 0.01  # [], [s], []
START_SHARES = (0.1, 0.3, 0.7)  # of the rms deflection: initial gaps of a search
MIN_REVERSED_SHARE = 0.005  # of the samples with reversed load; with fewer a gap is only an offset
# Smallest share of the compliance that a start keeps beside a gap. Verdicts and values of three two-joint
# sets (backlash, hardening, ripple) agree to 1e-9 for 0.1, 0.2 and 0.4.
LEAST_COMPLIANCE = 0.2


class Backlash(LawEffect):
    """Play between the teeth: within the gap no torque is transmitted."""

    name = "backlash"
    title = "Backlash"
    where = "joint"
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
        flank = _flank(motion.time, _load(motion))
        return -values[0] * flank, -flank[None]

    def undecided(self, motion: JointMotion, values: Array) -> tuple[NDArray[np.bool_], Array]:
        idle = np.abs(_load(motion)) < 1
        return idle, np.full(len(idle), 2 * abs(float(values[0])))

    def only_an_offset(self, evidence: EffectEvidence) -> bool:
        """True for a joint whose load never changes sign: it never crosses the gap."""
        torque = evidence.torque
        return min(float((torque > 0).mean()), float((torque < 0).mean())) < MIN_REVERSED_SHARE

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


def _load(motion: JointMotion) -> Array:
    """Torque relative to the threshold of an unloaded joint, shape (N,): within ±1 inside the gap."""
    around = _largest_within(round(RINGING_TIME / motion.step), np.abs(motion.torque))
    return motion.torque / np.maximum(RINGING_SHARE * around + FAINT_SHARE * motion.torque_scale, 1e-9)


def _largest_within(reach: int, values: Array) -> Array:
    """Largest of the values up to `reach` samples away, shape (N,)."""
    largest, span = np.pad(values, reach, mode="edge"), 1  # over `span` samples from each one on
    while span <= reach:
        largest, span = np.maximum(largest[:-span], largest[span:]), 2 * span
    return np.maximum(largest[: len(values)], largest[2 * reach + 1 - span :])


def _flank(time: Array, load: Array) -> Array:
    """Position in the gap from flank to flank, −1 … 1, shape (N,).

    Inside the gap the torque is zero and the law undefined: the joint is assumed to cross it at constant
    speed between unloading and reloading.
    """
    loaded = np.abs(load) > 1
    if not loaded.any():
        return load
    ends = np.flatnonzero(loaded[:-1] & ~loaded[1:])  # the last loaded sample before a gap
    begins = np.flatnonzero(~loaded[:-1] & loaded[1:])  # the last idle one
    through = np.flatnonzero(loaded[:-1] & loaded[1:] & (load[:-1] * load[1:] < 0))
    at, flank = [time[:1], time[-1:]], [np.sign(load[loaded][:1]), np.sign(load[loaded][-1:])]
    for before, after in ((ends, 0), (begins, 1), (through, 0), (through, 1)):
        sign = np.sign(load[before + after])
        share = (sign - load[before]) / (load[before + 1] - load[before])
        at.append(time[before] + share * (time[before + 1] - time[before]))
        flank.append(sign)
    instants, flanks = np.concatenate(at), np.concatenate(flank)
    order = np.argsort(instants, kind="stable")
    return np.interp(time, instants[order], flanks[order])
