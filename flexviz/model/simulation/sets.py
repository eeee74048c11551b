"""Simulation of a whole measurement set, written with its truth."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from flexviz.base.errors import InputError, choose_from
from flexviz.base.progress import ProgressCallback, StopCallback, ignore, never, part
from flexviz.base.units import joint_units
from flexviz.data.measurements import GroupTable, check_free, read_set, write_set
from flexviz.model.compensation import read_friction_table
from flexviz.model.effects import EFFECTS
from flexviz.model.simulation.from_urdf import plan_from_urdf
from flexviz.model.simulation.inject import at_temperatures, inject
from flexviz.model.simulation.plan import Plan
from flexviz.model.simulation.presets import PRESETS
from flexviz.model.simulation.resimulating import plan_from_set
from flexviz.model.simulation.run import STARTS, Run
from flexviz.robot.model import INERTIAL_UNITS, JOINT_UNITS, FlexibleModel
from flexviz.robot.robot_files import DESCRIPTION_SUFFIXES


@dataclass(frozen=True)
class SimulatedSet:
    """A simulated measurement set on disk."""

    folder: Path
    plan: Plan
    seed: int


def make_plan(
    preset_or_set: str | Path,
    effects: Sequence[str] = (),
    start: str = "rest",
    temperatures: Sequence[float] = (),
    gravity: Sequence[float] | None = None,
) -> Plan:
    """The plan of a preset, of a robot's URDF, or of a set to repeat, with effects hidden in it.

    `temperatures` [°C]: one per group, or one for all; none leaves them as they are. `gravity` (3,) [m/s²] in
    the base's frame; None leaves it as it is.
    """
    if start not in STARTS:
        raise InputError(f'start "{start}" does not exist; {choose_from(start, STARTS)}')
    name = str(preset_or_set)
    if name in PRESETS:
        plan = PRESETS[name]()
    elif Path(name).suffix.lower() in DESCRIPTION_SUFFIXES:
        plan = plan_from_urdf(name)
    elif Path(name).exists():
        plan = plan_from_set(read_set(name))
    else:
        valid = choose_from(name, PRESETS)
        raise InputError(f'"{name}" is neither a preset nor a measurement set; {valid}')
    robot = plan.robot if gravity is None else plan.robot.mounted(gravity)
    plan = replace(plan, start=start, robot=robot)
    return inject(at_temperatures(plan, temperatures) if temperatures else plan, effects)


def simulate_preset(
    preset_or_set: str | Path,
    out: str | Path,
    effects: Sequence[str] = (),
    seed: int = 0,
    start: str = "rest",
    progress: ProgressCallback = ignore,
    should_stop: StopCallback = never,
    *,
    temperatures: Sequence[float] = (),
    gravity: Sequence[float] | None = None,
    compensate: Path | None = None,
    overwrite: bool = False,
    table_format: str = "parquet",
) -> SimulatedSet:
    """Simulate a preset, a URDF or a measurement set, and write it to `out` completely or not at all.

    Equal arguments give equal numbers. `temperatures` [°C] are those of the groups, one each or one for all;
    the set then states them. `gravity` (3,) [m/s²] is in the base's frame; None: as it is. `compensate`: a
    table of friction that the controller adds; the recorded torque is without it.

    Raises:
        Cancelled: `should_stop` returned True.
    """
    check_free(Path(out).absolute(), overwrite)  # before the work, not after it
    plan = make_plan(preset_or_set, effects, start, temperatures, gravity)
    if compensate is not None:
        plan = replace(plan, compensation=read_friction_table(compensate, plan.robot.joints))
    runs = simulate_plan(plan, seed, progress, should_stop)
    return SimulatedSet(
        write_plan(plan, runs, out, seed, overwrite=overwrite, table_format=table_format), plan, seed
    )


def simulate_plan(
    plan: Plan, seed: int = 0, progress: ProgressCallback = ignore, should_stop: StopCallback = never
) -> dict[str, Run]:
    """Group name -> its recording."""
    return record(plan, move(plan, seed, progress, should_stop), seed)


def move(
    plan: Plan, seed: int = 0, progress: ProgressCallback = ignore, should_stop: StopCallback = never
) -> dict[str, Run]:
    """Group name -> its motion without measurement noise; `seed` is for noise that is fed back.

    For many noise seeds of one plan, call `move` once and `record` per seed.
    """
    runs: dict[str, Run] = {}
    total = sum(group.duration for group in plan.groups)
    done = 0.0
    for k, group in enumerate(plan.groups):
        rng = np.random.default_rng([seed, k])
        end = done + group.duration
        told = part(progress, done / total, end / total, f"simulating {group.name}")
        runs[group.name] = plan.run(group, seed=rng, progress=told, should_stop=should_stop)
        done = end
    return runs


def record(plan: Plan, runs: dict[str, Run], seed: int) -> dict[str, Run]:
    """The motions of `move` as the plan's sensors record them with this seed."""
    if plan.sensors.feedback:
        return runs
    return {
        group.name: runs[group.name].measured(plan.sensors, np.random.default_rng([seed, k]))
        for k, group in enumerate(plan.groups)
    }


def write_plan(
    plan: Plan,
    runs: dict[str, Run],
    out: str | Path,
    seed: int = 0,
    *,
    overwrite: bool = False,
    table_format: str = "parquet",
) -> Path:
    """Write simulated groups as a measurement set with its truth.json."""
    tables, names = [], ("time", "theta", "tau", "theta_ref", *(("q", "tau_joint") if plan.extra else ()))
    for group in plan.groups:
        columns = {name: getattr(runs[group.name], name) for name in names}
        columns |= {"validation": group.validation, "temperature": group.temperature}
        tables.append(GroupTable(group.name, group.trajectory, group.payload, **columns))
    text = json.dumps(truth(plan, seed), indent=1, ensure_ascii=False) + "\n"
    controller = plan.controller
    return write_set(
        out,
        robot=plan.source,
        joints=plan.robot.joints,
        groups=tables,
        payloads=plan.payloads,
        gravity=plan.robot.gravity,
        torque_hold=next((run.torque_hold for run in runs.values()), controller.cycle),
        initial_stiffness=plan.initial_stiffness,
        initial_motor_inertia=plan.initial_motor_inertia,
        kp=np.broadcast_to(controller.kp, plan.robot.n),
        kd=np.broadcast_to(controller.kd, plan.robot.n),
        effects=plan.effects,
        files={**plan.files, "truth.json": text},
        table_format=table_format,
        single=plan.single,
        overwrite=overwrite,
    )


def truth(plan: Plan, seed: int) -> dict[str, Any]:
    """The content of `truth.json`."""
    return {
        "format": 1,
        "simulated": True,
        "preset": plan.name,
        "seed": seed,
        "start": plan.start,
        "note": str(plan.note),
        "joints": list(plan.robot.joints),
        "parameters": true_parameters(plan.model, plan.robot.prismatic),
        "effects": true_effects(plan.model, plan.robot.prismatic),
    }


def true_parameters(model: FlexibleModel, slides: Iterable[Any]) -> list[dict[str, Any]]:
    """All parameters of the model, without payload; `slides`: (n,) the prismatic joints."""
    columns = {name: (getattr(model, name), joint_units(unit, slides)) for name, unit in JOINT_UNITS.items()}
    viscous = model.link_viscous_friction + model.motor_viscous_friction
    columns["viscous_friction_sum"] = viscous, joint_units("Nm s/rad", slides)
    for k, (name, unit) in enumerate(INERTIAL_UNITS.items()):
        columns[name] = model.inertial[:, k], (unit,) * model.n
    return [
        {"name": name, "joint": joint, "value": float(values[i]), "unit": units[i]}
        for name, (values, units) in columns.items()
        for i, joint in enumerate(model.joints)
    ]


def true_effects(model: FlexibleModel, slides: Iterable[Any]) -> list[dict[str, Any]]:
    """All effects with their parameters; `slides`: (n,) the prismatic joints."""
    sliding = {joint for joint, one in zip(model.joints, slides, strict=True) if one}
    return [
        {
            "effect": effect.effect,
            "joint": effect.joint,
            "group": effect.group,
            "payload": effect.payload,
            "parameters": {
                name: {"value": float(value), "unit": units[name]}
                for name, value in effect.parameters.items()
            },
        }
        for effect in model.effects
        for units in [EFFECTS[effect.effect].units_on(effect.joint in sliding)]
    ]
