"""What the tests of servos' exports share: a model as a result, and its motion in MuJoCo."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.servo import TrajectoryJudge
from flexviz.content.results import ResultDocument
from flexviz.data.measurements import MeasurementSet
from flexviz.model.servo import servo_values
from flexviz.outlets.exporting import Exported, IdentifiedRobot
from tests.independent.servo_simulator import Servo

Array = NDArray[np.float64]
PARAMETERS: Mapping[str, tuple[str, ...]] = {
    "coulomb_friction": ("coulomb",), "load_dependent_friction": ("coefficient",),
    "driving_friction": ("motor_driving", "load_driving"), "stribeck_friction": ("stribeck", "velocity"),
    "quadratic_friction": ("quadratic",), "torque_offset": ("offset",), "torque_limit": ("limit",),
    "goal_delay": ("delay",), "dead_band": ("half_width",), "goal_lag": ("time_constant",),
    "goal_speed_limit": ("speed",),
}  # fmt: skip


def document(joints: Sequence[str], servos: Sequence[Servo]) -> ResultDocument:
    """The truth as a result, as if every value had been found to 5 %."""
    values, effects = [], []
    for joint, servo in zip(joints, servos, strict=True):
        own = {"motor_inertia": servo.armature, "motor_viscous_friction": servo.viscous}
        laws = {"position_control": {"gain": servo.gain}} | {
            name: dict(zip(PARAMETERS[name], numbers, strict=True)) for name, numbers in servo.effects.items()
        }
        own |= {f"{name}.{key}": value for name, law in laws.items() for key, value in law.items()}
        more = {"unit": "", "identifiable": "yes", "start": 0.0, "at_bound": False, "tied_to": []}
        values += [{"name": k, "joint": joint, "value": v, "std": 0.05 * v} | more for k, v in own.items()]
        effects += [
            {
                "effect": name,
                "joint": joint,
                "parameters": {k: {"value": v, "unit": ""} for k, v in law.items()},
            }
            for name, law in laws.items()
        ]
    return ResultDocument.model_validate(
        {"format": 1, "set": "made", "parameters": values, "effects": effects, "converged": True}
    )


def in_mujoco(done: Exported, measured: MeasurementSet, group: str) -> Array:
    """(N, n) motion [rad] of an exported model from a group's first sample, driven by its goals alone."""
    mujoco: Any = import_module("mujoco")

    (one,) = (g for g in measured.groups if g.name == group)
    model = mujoco.MjModel.from_xml_path(str(done.files["mjcf"][0]))
    steps = [file for file in done.files["mjcf"] if file.suffix == ".py"]
    angles = []
    for segment in one.segments:
        data = mujoco.MjData(model)
        goals = one.at("theta_ref", segment.time)
        assert goals is not None
        at = [model.joint(name).qposadr[0] for name in measured.joints]
        data.qpos[at] = segment.theta[0]
        servos = module(steps[0]).Servos(model, data, goals[0]) if steps else None
        for row in goals:
            angles.append(data.qpos[at].copy())
            for _ in range(round(segment.step / model.opt.timestep)):
                if servos is None:
                    data.ctrl[: len(row)] = row
                    mujoco.mj_step(model, data)
                else:
                    servos.step(row)
    return np.array(angles)


def module(file: Path) -> Any:
    """An exported Python file, imported."""
    spec = importlib.util.spec_from_file_location(file.stem, file)
    assert spec is not None and spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


def both_errors(made: IdentifiedRobot, done: Exported, groups: Sequence[str]) -> tuple[Array, Array, Array]:
    """(n,) rms of both models' errors, MuJoCo's and flexviz' own, and of what they differ by [rad].

    Without the first second, which shows how the motion began.
    """
    measured = made.measurements
    values = servo_values(made.model)
    runs = TrajectoryJudge(measured).refreshed(values).runs(values)
    rows = []
    for group in groups:
        own = runs[group]
        theta = in_mujoco(done, measured, group)
        late = own.time > own.time[0] + 1.0
        rows.append(np.stack((theta - own.theta + own.error, own.error, theta - own.theta), axis=1)[late])
    rms = np.sqrt(np.mean(np.square(np.concatenate(rows)), axis=0))
    return rms[0], rms[1], rms[2]
