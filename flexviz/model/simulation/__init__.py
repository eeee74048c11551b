"""Forward simulation of flexible-joint robots with controller, sensors and effects."""

from flexviz.model.simulation.building import check_effect, make_plant, simulated_effects
from flexviz.model.simulation.control import PDController
from flexviz.model.simulation.effect_laws import neighbour, scaled_body, tilted_gravity
from flexviz.model.simulation.following import follow
from flexviz.model.simulation.inject import MotionScale, default_parameters, inject, motion_scale
from flexviz.model.simulation.laws import ExtraLaw, Pull
from flexviz.model.simulation.model_replay import replay
from flexviz.model.simulation.plan import Plan, PlannedGroup
from flexviz.model.simulation.presets import PRESETS, perturbed
from flexviz.model.simulation.rates import fastest
from flexviz.model.simulation.references import Fourier, Reference, Sampled, Sinusoid, random_fourier
from flexviz.model.simulation.resimulating import plan_from_set
from flexviz.model.simulation.run import Run, simulate_run
from flexviz.model.simulation.sensors import Sensors
from flexviz.model.simulation.sets import (
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
