"""Two user-defined effects for --effects-from: worm gear and cubic friction."""

from math import tanh

import numpy as np

from flexviz.effects import JointMotion, JointState, LinearEffect, ParameterSpec, smooth_sign


class WormGearFriction(LinearEffect):
    """Dry friction that is not the same forwards and backwards, as behind a worm gear."""

    name = "worm_gear_friction"
    title = "Worm gear friction"
    where = "motor"  # u is subtracted from the motor torque
    explanation = "Dry friction opposes the motion with one torque forwards and another one backwards."
    equation = "u = f_p for θ̇ > 0, −f_n for θ̇ < 0"
    signature = "Steps at reversals that are not symmetric about zero."
    confirm = "Slow motions with many reversals, in poses with opposite gravity load."
    reference = (
        "Armstrong-Hélouvry, Dupont, Canudas de Wit: A survey of models, analysis tools and compensation "
        "methods for the control of machines with friction, Automatica 30(7), 1994"
    )
    parameters = (
        ParameterSpec("forward", "Nm", lower=0.0, explanation="friction at positive speed", symbol="f_p"),
        ParameterSpec("backward", "Nm", lower=0.0, explanation="friction at negative speed", symbol="f_n"),
    )
    replaces = "coulomb_friction"
    example = (4.0, 2.5)

    def columns(self, motion: JointMotion) -> np.ndarray:
        """∂u/∂f_p and ∂u/∂f_n along the motion, shape (2, N)."""
        sign = smooth_sign(motion.velocity)
        return np.stack((0.5 * (sign + 1.0), 0.5 * (sign - 1.0)))

    def simulation(self, values: np.ndarray):
        """The same for the simulator: the torque at one instant."""
        forward, backward = values.tolist()

        def torque(at: JointState) -> float:
            sign = tanh(at.theta_velocity / 0.005)
            return 0.5 * (forward * (sign + 1.0) + backward * (sign - 1.0))

        return torque


class CubicFriction(LinearEffect):
    """Viscous friction that grows with the third power of the speed."""

    name = "cubic_friction"
    title = "Cubic friction"
    where = "motor"
    explanation = "Friction grows with the third power of the speed."
    equation = "u = f_3 θ̇³"
    signature = "A cubic curve against velocity."
    confirm = "The same motion at clearly different speeds."
    reference = (
        "Armstrong-Hélouvry, Dupont, Canudas de Wit: A survey of models, analysis tools and compensation "
        "methods for the control of machines with friction, Automatica 30(7), 1994"
    )
    parameters = (
        ParameterSpec("cubic", "Nm s³/rad³", lower=0.0, explanation="friction at 1 rad/s", symbol="f_3"),
    )
    smooth = True  # u has no jump anywhere
    example = (0.8,)

    def columns(self, motion: JointMotion) -> np.ndarray:
        """∂u/∂f_3, shape (1, N)."""
        return motion.velocity[np.newaxis] ** 3

    def simulation(self, values: np.ndarray):
        """The same for the simulator."""
        cubic = float(values[0])
        return lambda at: cubic * at.theta_velocity**3
