"""A case becomes a measurement set, and its truth lies elsewhere: the diagnosis never sees it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from benchmarks.diagnosis_study.making import UNSCORED, base_truth, write_runs
from benchmarks.diagnosis_study.motions import workload
from benchmarks.diagnosis_study.robots import stiff_plan
from benchmarks.robotlike_study.cases import RobotCase
from benchmarks.robotlike_study.effects import draw_also, draw_effects, draw_laws
from benchmarks.robotlike_study.shares import effect_torque, law_torque, share
from benchmarks.running import Json, case_folder, truth_file, write
from flexviz.model.simulation import Plan, Run, fastest, make_plant, move, record

Logging = Callable[[Run], Run]

LARGEST_PHASE = 0.9  # [rad] of the fastest vibration per integration step; a third of it moves θ by 1e-9 rad
LARGEST_DECAY = 1.6  # [-] integration step times the fastest decay rate


def make(work: Path, case: RobotCase) -> None:
    """Simulate a case and write it."""
    write_case(work, case, *plan_of(case))


def write_case(
    work: Path, case: RobotCase, plan: Plan, kinds: tuple[str, ...] = (), logged: Logging | None = None
) -> None:
    """Simulate a plan and write it as a case: its set, then its truth.

    Args:
        work: folder of the study.
        case: gives the name and the noise.
        plan: with everything hidden in it.
        kinds: of its laws that the library does not have.
        logged: what becomes of the sensors' signals before they are written; nothing by default.
    """
    seed = int(case.rng("noise").integers(2**31))
    moved = move(plan, seed)
    recorded = record(plan, moved, seed)
    written = {name: logged(run) for name, run in recorded.items()} if logged else recorded
    write_runs(case_folder(work, case.name), plan, written)
    write(truth_file(work, case.name), truth(case, plan, kinds, moved, recorded))


def plan_of(case: RobotCase) -> tuple[Plan, tuple[str, ...]]:
    """The plan with everything hidden in it, and the kinds of its laws that the library does not have."""
    plan = stiff_plan(case.robot, case.duration, case.rng("robot"))
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
) -> Json:
    """What is hidden in a case, the largest share first, and how it was recorded."""
    held_out = next(g for g in plan.groups if g.validation)
    run, sensors = moved[held_out.name], plan.sensors
    spread = dict(zip(plan.robot.joints, recorded[held_out.name].tau.std(axis=0), strict=True))
    hidden: list[Json] = []
    for effect in plan.model.effects:
        assert effect.joint is not None
        torque = effect_torque(plan, held_out, run, effect)
        scored = {k: v for k, v in effect.parameters.items() if k not in UNSCORED}
        entry = {"effect": effect.effect, "joint": effect.joint, "parameters": scored}
        hidden.append(entry | share(torque, spread[effect.joint]) | {"all_parameters": effect.parameters})
    for kind, (joint, law) in zip(kinds, plan.laws, strict=True):
        entry = {"effect": "unknown", "joint": joint, "parameters": asdict(law), "kind": kind}  # type: ignore[call-overload]
        hidden.append(entry | share(law_torque(plan, run, joint, law), spread[joint]))
    if sensors.torque_filter:
        hidden.append(filter_delay(run, sensors.torque_filter))
    return base_truth(case, plan, sorted(hidden, key=lambda e: -e["share"])) | {
        "cycle": plan.controller.cycle,
        "encoder_step": np.asarray(sensors.resolution).tolist(),
        "theta_noise": np.asarray(sensors.theta_noise).tolist(),
        "torque_noise": np.asarray(sensors.torque_noise).tolist(),
        "torque_filter_hertz": sensors.torque_filter / (2 * np.pi),
    }


def filter_delay(run: Run, bandwidth: float) -> Json:
    """What a first-order filter in the torque's record is in the library: a torque applied before it is seen.

    Its share is that of the joint on which it matters most.
    """
    delay = -1.0 / bandwidth  # [s]
    change = np.abs(delay) * np.gradient(run.tau, run.time, axis=0)
    found = [share(change[:, i], float(run.tau[:, i].std())) for i in range(run.tau.shape[1])]
    values = {"parameters": {"delay": delay}, "all_parameters": {"delay": delay}}
    return {"effect": "torque_delay", "joint": None} | values | max(found, key=lambda one: one["share"])
