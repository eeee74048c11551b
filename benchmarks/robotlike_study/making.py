"""A case becomes a measurement set, and its truth lies elsewhere: the diagnosis never sees it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.diagnosis_study.making import UNSCORED, case_folder, truth_file
from benchmarks.kept_results import write
from benchmarks.robotlike_study.cases import RobotCase
from benchmarks.robotlike_study.effects import draw_also, draw_effects
from benchmarks.robotlike_study.laws import draw_laws
from benchmarks.robotlike_study.motions import workload
from benchmarks.robotlike_study.robots import random_plan
from benchmarks.robotlike_study.shares import effect_torque, law_torque, share
from flexviz.measurements import GroupTable, write_set
from flexviz.simulation import Plan, Run, fastest, make_plant, move, record

Logging = Callable[[Run], Run]

LARGEST_PHASE = 0.9  # [rad] of the fastest vibration per integration step; a third of it moves θ by 1e-9 rad
LARGEST_DECAY = 1.6  # [-] integration step times the fastest decay rate


def is_made(work: Path, case: RobotCase) -> bool:
    """Whether the set and its truth are there; the truth is written last."""
    return truth_file(work, case.name).is_file() and case_folder(work, case.name).is_dir()


def make(work: Path, case: RobotCase) -> None:
    """Simulate a case and write it."""
    plan, kinds = plan_of(case)
    write_case(work, case, plan, kinds)


def write_case(
    work: Path, case: RobotCase, plan: Plan, kinds: tuple[str, ...] = (), logged: Logging | None = None
) -> None:
    """Simulate a plan and write it as a case: its set, then its truth.

    Args:
        work: folder of the study.
        case: gives the name and the noise.
        plan: with everything hidden in it.
        kinds: of its laws that no library has.
        logged: what becomes of the sensors' signals before they are written; nothing by default.
    """
    seed = int(case.rng("noise").integers(2**31))
    moved = move(plan, seed)
    recorded = record(plan, moved, seed)
    written = {name: logged(run) for name, run in recorded.items()} if logged else recorded
    tables = [
        GroupTable(g.name, g.trajectory, g.payload, written[g.name].time, written[g.name].theta,
                   written[g.name].tau, validation=g.validation)
        for g in plan.groups
    ]  # fmt: skip
    write_set(
        case_folder(work, case.name),
        robot=plan.source,
        joints=plan.robot.joints,
        groups=tables,
        payloads=plan.payloads,
        torque_hold=recorded[plan.groups[0].name].torque_hold,
        initial_stiffness=plan.initial_stiffness,
        initial_motor_inertia=plan.initial_motor_inertia,
        files=plan.files,
        overwrite=True,
    )
    write(truth_file(work, case.name), truth(case, plan, kinds, moved, recorded))


def plan_of(case: RobotCase) -> tuple[Plan, tuple[str, ...]]:
    """The plan with everything hidden in it, and the kinds of its laws that no library has."""
    plan = random_plan(case, case.rng("robot"))
    work = workload(plan)
    hidden = draw_effects(case.robot, plan, work, case.rng("effects"))
    hidden += draw_also(case.also, hidden, plan, work, case.rng("also"))
    laws = draw_laws(plan, work, case.rng("laws"))
    plan = replace(
        plan,
        model=replace(plan.model, effects=hidden),
        laws=tuple((joint, law) for _, joint, law in laws),
    )
    return replace(plan, step=integration_step(plan)), tuple(kind for kind, _, _ in laws)


def integration_step(plan: Plan) -> float:
    """The longest integration step that all groups allow [s]."""
    steps = []
    for group in plan.groups:
        plant, _ = make_plant(plan.robot, plan.model, plan.payloads[group.payload])
        plant.extra += [(int(plan.robot.order[plan.robot.joints.index(j)]), law) for j, law in plan.laws]
        positions = group.reference.sample(np.linspace(0.0, group.duration, 12))[0]
        motion = fastest(plant, plan.robot.to_pin(positions))
        steps.append(min(LARGEST_PHASE / motion.vibration, LARGEST_DECAY / motion.decay))
    cycle = plan.controller.cycle
    return cycle / np.ceil(cycle / min(steps))


def truth(
    case: RobotCase, plan: Plan, kinds: tuple[str, ...], moved: dict[str, Run], recorded: dict[str, Run]
) -> dict[str, Any]:
    """What is hidden in a case, the largest share first, and how it was recorded."""
    model, held_out = plan.model, next(g for g in plan.groups if g.validation)
    run, joints = moved[held_out.name], list(plan.robot.joints)
    spread = recorded[held_out.name].tau.std(axis=0)
    hidden: list[dict[str, Any]] = []
    for effect in model.effects:
        assert effect.joint is not None
        rms, part = share(effect_torque(plan, held_out, run, effect), spread[joints.index(effect.joint)])
        scored = {k: v for k, v in effect.parameters.items() if k not in UNSCORED}
        hidden.append(
            {
                "effect": effect.effect,
                "joint": effect.joint,
                "parameters": scored,
                "torque_rms": rms,
                "share": part,
            }
            | {"all_parameters": dict(effect.parameters)}
        )
    for kind, (joint, law) in zip(kinds, plan.laws, strict=True):
        rms, part = share(law_torque(plan, run, joint, law), spread[joints.index(joint)])
        values = asdict(law)  # type: ignore[call-overload]
        hidden.append(
            {"effect": "unknown", "joint": joint, "parameters": values, "torque_rms": rms, "share": part}
            | {"kind": kind}
        )
    sensors = plan.sensors
    if sensors.torque_filter:
        hidden.append(filter_delay(run, sensors.torque_filter))
    return {
        "case": case.name,
        "robot": case.robot,
        "joints": joints,
        "seed": case.seed,
        "effects": sorted(hidden, key=lambda e: -e["share"]),
        "stiffness": model.stiffness.tolist(),
        "motor_inertia": model.motor_inertia.tolist(),
        "viscous_link": model.link_viscous_friction.tolist(),
        "viscous_motor": model.motor_viscous_friction.tolist(),
        "inertial": model.inertial.tolist(),
        "cycle": plan.controller.cycle,
        "encoder_step": np.asarray(sensors.resolution).tolist(),
        "theta_noise": np.asarray(sensors.theta_noise).tolist(),
        "torque_noise": np.asarray(sensors.torque_noise).tolist(),
        "torque_filter_hertz": sensors.torque_filter / (2 * np.pi),
    }


def filter_delay(run: Run, bandwidth: float) -> dict[str, Any]:
    """What a first-order filter in the torque's record is in the library: a torque applied before it is seen.

    Its share is that of the joint on which it matters most.
    """
    delay = -1.0 / bandwidth  # [s]
    change = np.abs(delay) * np.gradient(run.tau, run.time, axis=0)
    found = [share(change[:, i], float(run.tau[:, i].std())) for i in range(run.tau.shape[1])]
    rms, part = max(found, key=lambda pair: pair[1])
    return {
        "effect": "torque_delay",
        "joint": None,
        "parameters": {"delay": delay},
        "torque_rms": rms,
        "share": part,
        "all_parameters": {"delay": delay},
    }
