"""Effects of the drive that are not friction."""

import numpy as np

from flexviz.effects.base import Array, Effect, JointMotion, ParameterSpec


class TorqueOffset(Effect):
    """A constant torque, from a current sensor's offset or an asymmetric load."""

    name = "torque_offset"
    title = "Torque offset"
    where = "motor"
    explanation = (
        "The recorded torque is wrong by a constant, for example from a current sensor's zero error."
    )
    equation = "u = f_0"
    reference = (
        "Swevers, Verdonck, De Schutter: Dynamic model identification for industrial robots, "
        "IEEE Control Systems Magazine 27(5), 2007"
    )
    parameters = (ParameterSpec("offset", "Nm", explanation="constant torque"),)

    def columns(self, motion: JointMotion) -> Array:
        return np.ones((1, len(motion.time)))
