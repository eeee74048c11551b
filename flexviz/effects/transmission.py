"""Effects of the elastic transmission: what the deflection θ − q is at a given torque."""

from __future__ import annotations

import numpy as np

from flexviz.effects.base import (
    Array,
    JointMotion,
    LawEffect,
    ParameterSpec,
)
from flexviz.effects.motor import ORDER, PHASE, Ripple

_SPONG = "Spong: Modeling and control of elastic joint robots, ASME J. Dyn. Syst. Meas. Control 109(4), 1987"


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

    def law(self, motion: JointMotion, values: Array) -> tuple[Array, Array]:
        stiffness, cubic = motion.stiffness, max(float(values[0]), 0.0)
        linear = motion.torque / stiffness
        x = linear.copy()
        for _ in range(30):  # Newton from the outside of a convex function: monotone
            change = (stiffness * x + cubic * x**3 - motion.torque) / (stiffness + 3 * cubic * x**2)
            x -= change
            if np.max(np.abs(change)) < 1e-14:
                break
        return linear - x, (x**3 / (stiffness + 3 * cubic * x**2))[None]


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
        # inside the gap the torque is zero and the law has no answer: the sign is smoothed over the noise
        side = np.tanh(motion.torque / max(4e-3 * motion.torque_scale, 1e-9))
        return -values[0] * side, -side[None]


class JointDamping(LawEffect):
    """Damping of the transmission, beside its spring.

    τ_j = K x + D ẋ gives x = s/K − D ṡ/K² + …; u = s/K − x to second order in D.
    """

    name = "joint_damping"
    title = "Joint damping"
    where = "joint"
    explanation = "The gear's elasticity is damped: part of its torque follows the speed of the deflection."
    equation = "τ_j = K δ + D δ̇"
    signature = "Position error in proportion to the transmitted torque's rate of change."
    confirm = "Fast motions that excite the joint's resonance."
    reference = _SPONG
    parameters = (ParameterSpec("damping", "Nm s/rad", 0.0, explanation="of the deflection", symbol="D"),)
    state = True

    def law(self, motion: JointMotion, values: Array) -> tuple[Array, Array]:
        step = motion.time[1] - motion.time[0]
        count = len(motion.torque)
        mirrored = np.concatenate((motion.torque, motion.torque[::-1]))
        spectrum = np.fft.rfft(mirrored)
        iw = 2j * np.pi * np.fft.rfftfreq(2 * count, step)
        impedance = motion.stiffness + values[0] * iw
        u = np.fft.irfft(spectrum * (1 / motion.stiffness - 1 / impedance), 2 * count)[:count]
        slope = np.fft.irfft(spectrum * iw / impedance**2, 2 * count)[:count]
        return u, slope[None]


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
