"""Forward simulation of flexible-joint robots: both sides, controller, sensors and every effect."""

from flexviz.simulation.control import Controller
from flexviz.simulation.references import Fourier, Reference, Sampled, Sinusoid, random_fourier
from flexviz.simulation.run import Run, simulate_run
from flexviz.simulation.sensors import Sensors

__all__ = [
    "Controller",
    "Fourier",
    "Reference",
    "Run",
    "Sampled",
    "Sensors",
    "Sinusoid",
    "random_fourier",
    "simulate_run",
]
