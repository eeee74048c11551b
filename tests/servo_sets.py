"""Measurement sets of joints that follow goals, simulated by MuJoCo."""

from __future__ import annotations

from collections.abc import Sequence
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


ARM = """<robot name="arm"><link name="base"/>
<link name="upper"><inertial><origin xyz="0.1 0 0"/><mass value="0.5"/>
<inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="lower"><inertial><origin xyz="0.08 0 0"/><mass value="0.3"/>
<inertia ixx="5e-4" iyy="5e-4" izz="5e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="10" velocity="10"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.2 0 0"/>
<axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="10" velocity="10"/></joint></robot>"""


def arm_set(folder: Path, servos: Sequence[Servo], seconds: float = 10.0) -> MeasurementSet:
    """One motion to fit and one held out of an arm with two level joints, at 100 Hz."""
    urdf = folder / "arm.urdf"
    urdf.write_text(ARM, encoding="utf-8")
    runs = {
        f"g{k}": simulated(urdf, ["shoulder", "elbow"], servos, random_goals(k, 2, 1.2, 0.8), seconds, 0.01)
        for k in range(2)
    }
    return MeasurementSet.from_arrays(urdf, runs, validation="g1", drive={"from": "goal"})
