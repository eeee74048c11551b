"""Temperature-dependent friction."""

from __future__ import annotations

import numpy as np

from flexviz.model.effects.effect import JointScale
from flexviz.model.effects.law import LinearEffect
from flexviz.model.effects.terms import Array, JointMotion, ParameterSpec, smooth_sign

REFERENCE = 20.0  # [°C] at which friction is that of the rest of the model
USUAL_FALL = 0.012  # [1/K] of viscous friction


class TemperatureFriction(LinearEffect):
    """Friction that falls with the temperature of the runs.

    Viscous friction of a gear falls nearly exponentially as its lubricant warms, dry friction changes
    linearly. Runs at a few temperatures determine no more than a straight line for either.
    """

    name = "temperature_friction"
    title = "Temperature-dependent friction"
    where = "motor"
    plot_against = "velocity per degree"
    explanation = (
        "Warm lubricant is thin: friction is lower in runs that were recorded at a higher temperature."
    )
    equation = "u = (20 °C − T)(a_v θ̇ + a_c sign(θ̇)),  T the run's temperature"
    signature = (
        "Friction whose size differs between the runs but not within one, in the order of their temperatures."
    )
    confirm = "The same motion and payload with the robot cold and warm, with `temperature` stated per group."
    simulated = (
        "The same u opposes the motor. Groups that state no temperature are given 25, 45, 35, 40 °C in turn."
    )
    reference = (
        "Bittencourt, Gunnarsson: Static friction in a robot joint – modeling and identification of load and "
        "temperature effects, Journal of Dynamic Systems, Measurement, and Control 134(5), 2012"
    )
    parameters = (
        ParameterSpec(
            "viscous_fall", "Nm s/(rad K)", 0.0, explanation="of viscous friction per kelvin", symbol="a_v"
        ),
        ParameterSpec("coulomb_fall", "Nm/K", explanation="of dry friction per kelvin", symbol="a_c"),
    )
    size_at = (0, 1)
    by_temperature = True

    def columns(self, motion: JointMotion) -> Array:
        colder = REFERENCE - motion.temperature
        return colder * np.stack((motion.velocity, smooth_sign(motion.velocity)))

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (USUAL_FALL * scale.viscous, 0.0)
