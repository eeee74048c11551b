"""Forward simulation of flexible-joint robots with controller, sensors and effects."""

from flexviz.simulation.building import check_effect, make_plant, simulated_effects
from flexviz.simulation.control import PDController
from flexviz.simulation.effect_laws import neighbour, scaled_body, tilted_gravity
from flexviz.simulation.following import follow
from flexviz.simulation.inject import MotionScale, default_parameters, inject, motion_scale
from flexviz.simulation.laws import ExtraLaw, Pull
from flexviz.simulation.model_replay import replay
from flexviz.simulation.plan import Plan, PlannedGroup
from flexviz.simulation.presets import PRESETS, perturbed
from flexviz.simulation.rates import fastest
from flexviz.simulation.references import Fourier, Reference, Sampled, Sinusoid, random_fourier
from flexviz.simulation.resimulating import plan_from_set
from flexviz.simulation.run import Run, simulate_run
from flexviz.simulation.sensors import Sensors
from flexviz.simulation.sets import (
    SimulatedSet,
    make_plan,
    move,
    record,
    simulate_plan,
    simulate_preset,
    write_plan,
)

__all__ = [
    "PRESETS",
    "ExtraLaw",
    "Fourier",
    "MotionScale",
    "PDController",
    "Plan",
    "PlannedGroup",
    "Pull",
    "Reference",
    "Run",
    "Sampled",
    "Sensors",
    "SimulatedSet",
    "Sinusoid",
    "check_effect",
    "default_parameters",
    "fastest",
    "follow",
    "inject",
    "make_plan",
    "make_plant",
    "motion_scale",
    "move",
    "neighbour",
    "perturbed",
    "plan_from_set",
    "random_fourier",
    "record",
    "replay",
    "scaled_body",
    "simulate_plan",
    "simulate_preset",
    "simulate_run",
    "simulated_effects",
    "tilted_gravity",
    "write_plan",
]
