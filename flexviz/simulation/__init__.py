"""Forward simulation of flexible-joint robots: both sides, controller, sensors and every effect."""

from flexviz.simulation.control import Controller
from flexviz.simulation.own import JointState, OwnLaw, Pull
from flexviz.simulation.plan import Plan, PlannedGroup
from flexviz.simulation.presets import PRESETS
from flexviz.simulation.references import Fourier, Reference, Sampled, Sinusoid, random_fourier
from flexviz.simulation.replay import replay
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
    "Controller",
    "Fourier",
    "JointState",
    "OwnLaw",
    "Plan",
    "PlannedGroup",
    "Pull",
    "Reference",
    "Run",
    "Sampled",
    "Sensors",
    "SimulatedSet",
    "Sinusoid",
    "make_plan",
    "move",
    "random_fourier",
    "record",
    "replay",
    "simulate_plan",
    "simulate_preset",
    "simulate_run",
    "write_plan",
]
