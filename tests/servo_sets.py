"""Measurement sets of joints that follow goals, simulated by MuJoCo."""

from __future__ import annotations

from pathlib import Path

from flexviz.data.measurements import MeasurementSet
from tests.independent.servo_simulator import PENDULUM, Servo, random_goals, simulated


def pendulum_set(folder: Path, servo: Servo, axis: str = "0 1 0", seconds: float = 12.0) -> MeasurementSet:
    """Two motions to fit and one held out, at 100 Hz; about an upright axis gravity shows nothing."""
    urdf = folder / "pendulum.urdf"
    urdf.write_text(PENDULUM.format(mass=0.6, i=2e-4, axis=axis), encoding="utf-8")
    runs = {
        f"g{k}": simulated(urdf, ["hinge"], [servo], random_goals(k, 1, 1.2, 1.0), seconds, 0.01)
        for k in range(3)
    }
    return MeasurementSet.from_arrays(urdf, runs, validation="g2", drive={"from": "goal"})
