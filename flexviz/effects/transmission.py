"""Effects of the elastic transmission: what the deflection θ − q is at a given torque.

With every effect on, x = deadzone(θ + a sin(nθ + φ) − q, b) and s = K x + k₃ x³ + D ẋ. Backlash and
transmission error only shift x, so what q gains by each of them simply adds up. Hardening and damping do not:
what they do together beyond the sum of what each does alone is given half to each, at the present values of
both.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from flexviz.effects.base import Array, JointMotion, LawEffect, ParameterSpec
from flexviz.effects.elastic import ElasticJoint
from flexviz.effects.motor import ORDER, PHASE, Ripple

# a torque below these shares of its largest within a while and of its rms may be that of a joint in its gap:
# the observer lets a torque that has just fallen to zero ring
RINGING, WHILE, FAINT = 0.06, 0.08, 0.01  # [], [s], []


def _load(motion: JointMotion) -> Array:
    """The torque in units of what may be none at all, shape (N,): in the gap it is within ±1."""
    reach = 2 * round(WHILE / motion.step) + 1
    around = maximum_filter1d(np.abs(motion.torque), reach)
    return motion.torque / np.maximum(RINGING * around + FAINT * motion.torque_scale, 1e-9)


def _flank(time: Array, load: Array) -> Array:
    """Which flank of the gap transmits the torque, −1 … 1, shape (N,).

    Within the gap the torque is zero and the law has no answer: from the instant at which the joint is
    unloaded to that at which it is loaded again, it is taken to cross the gap evenly.
    """
    loaded = np.abs(load) > 1
    if not loaded.any():
        return np.clip(load, -1.0, 1.0)
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


def _joint(motion: JointMotion, cubic: float, damping: float) -> ElasticJoint:
    return ElasticJoint(
        motion.torque, motion.step, motion.stiffness, max(float(cubic), 0.0), max(float(damping), 0.0)
    )


def _gain(motion: JointMotion, joint: ElasticJoint) -> Array:
    """What q gains against the linear spring [rad]."""
    return motion.torque / motion.stiffness - joint.deflection


def _present(motion: JointMotion, effect: str) -> float:
    """The size of an effect that the joint has at present."""
    return max(motion.present.get(effect, (0.0,))[0], 0.0)


def _others(motion: JointMotion, effect: str) -> Array | float:
    """What of the gain of hardening and damping together belongs to the other one, `effect`, [rad].

    That is its own alone and half of what both do beyond the sum.
    """
    if not _present(motion, effect):
        return 0.0
    if effect not in motion.notes:
        cubic, damping = _present(motion, "stiffness_hardening"), _present(motion, "joint_damping")
        together, hardened, damped = (
            _gain(motion, _joint(motion, *both)) for both in ((cubic, damping), (cubic, 0.0), (0.0, damping))
        )
        motion.notes["joint_damping"] = 0.5 * (together + damped - hardened)
        motion.notes["stiffness_hardening"] = 0.5 * (together + hardened - damped)
    return motion.notes[effect]


class StiffnessHardening(LawEffect):
    """A gear that grows stiffer as it is wound up.

    K x + k₃ x³ = s is solved for the deflection x; u = s/K − x is what q gains against the linear spring.
    """

    name = "stiffness_hardening"
    title = "Stiffness hardening"
    where = "joint"
    explanation = "The gear grows stiffer as it is wound up, as harmonic drives do."
    equation = "τ_j = K δ + k₃ δ³"
    signature = "Position error against load that bends at high torque."
    confirm = "High loads in both directions."
    reference = (
        "Tuttle, Seering: A nonlinear model of a harmonic drive gear transmission, IEEE T-RA 12(3), 1996"
    )
    parameters = (
        ParameterSpec("cubic_stiffness", "Nm/rad³", 0.0, explanation="how much stiffer", symbol="k₃"),
    )
    state = True
    smooth = True

    def law(self, motion: JointMotion, values: Array) -> tuple[Array, Array]:
        joint = _joint(motion, values[0], _present(motion, "joint_damping"))
        return _gain(motion, joint) - _others(motion, "joint_damping"), -joint.slope_by_cubic()[None]


class Backlash(LawEffect):
    """Play between the teeth: within the gap no torque is transmitted."""

    name = "backlash"
    title = "Backlash"
    where = "joint"
    explanation = "Play between the gear's teeth: when the load changes sign the motor moves a little alone."
    equation = "τ_j = K · deadzone(δ, b)"
    signature = "A position step of 2b whenever the transmitted torque changes sign."
    confirm = "Slow motion through the pose of zero load."
    reference = (
        "Nordin, Gutman: Controlling mechanical systems with backlash — a survey, Automatica 38(10), 2002"
    )
    parameters = (ParameterSpec("half_width", "rad", 0.0, 0.2, "half the play", "b"),)
    state = True
    linear = True

    def law(self, motion: JointMotion, values: Array) -> tuple[Array, Array]:
        flank = _flank(motion.time, _load(motion))
        return -values[0] * flank, -flank[None]

    def undecided(self, motion: JointMotion, values: Array) -> tuple[NDArray[np.bool_], Array]:
        idle = np.abs(_load(motion)) < 1
        return idle, np.full(len(idle), 2 * abs(float(values[0])))


class JointDamping(LawEffect):
    """Damping of the transmission, beside its spring.

    K x + D ẋ = s is solved for the deflection x; u = s/K − x is what q gains against the spring alone.
    """

    name = "joint_damping"
    title = "Joint damping"
    where = "joint"
    explanation = "The gear's elasticity is damped: part of its torque follows the speed of the deflection."
    equation = "τ_j = K δ + D δ̇"
    signature = "Position error in proportion to the transmitted torque's rate of change."
    confirm = "Fast motions that excite the joint's resonance."
    reference = "De Luca, Farina, Lucibello: On the control of robots with visco-elastic joints, ICRA 2005"
    parameters = (ParameterSpec("damping", "Nm s/rad", 0.0, explanation="of the deflection", symbol="D"),)
    state = True
    smooth = True

    def law(self, motion: JointMotion, values: Array) -> tuple[Array, Array]:
        joint = _joint(motion, _present(motion, "stiffness_hardening"), values[0])
        return _gain(motion, joint) - _others(motion, "stiffness_hardening"), -joint.slope_by_damping()[None]


class TransmissionError(Ripple):
    """Kinematic error of the gear: the link is not quite where the motor angle says."""

    name = "transmission_error"
    title = "Transmission error"
    where = "joint"
    explanation = "The gear's teeth are not perfect: the link's position errs periodically with the angle."
    equation = "δ = θ + a sin(nθ + φ) − q"
    signature = "A sine against position in the position error; in torque it grows with the speed squared."
    confirm = "The same motion at different speeds."
    reference = (
        "Gandhi, Ghorbel: Closed-loop compensation of kinematic error in harmonic drives, T-CST 10(6), 2002"
    )
    parameters = (
        ParameterSpec("amplitude", "rad", explanation="largest error", symbol="a"),
        ORDER,
        PHASE,
    )
