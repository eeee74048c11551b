"""A case becomes a measurement set, and its truth lies elsewhere: the diagnosis never sees it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.diagnosis_study.cases import Case
from benchmarks.diagnosis_study.laws import EXTRA_LAWS, place
from benchmarks.diagnosis_study.robots import random_plan
from benchmarks.diagnosis_study.sizes import SIZES, draw, natural
from benchmarks.running import Json, as_done, case_folder, is_made, truth_file, workers, write
from flexviz.data.measurements import GroupTable, write_set
from flexviz.model.effects import EFFECTS
from flexviz.model.simulation import MotionScale, Plan, Run, motion_scale, move, record
from flexviz.robot.model import EffectValue

UNSCORED = {"phase", "rest_angle", "tilt_x"}  # ambiguous, or relative to nothing


def make_all(work: Path, cases: Sequence[Any], make: Callable[[Path, Any], None], jobs: int) -> int:
    """Simulate what is not there yet; 1 if a case failed."""
    missing = {case.name: (work, case) for case in cases if not is_made(work, case.name)}
    return int(sum(1 for _ in as_done(workers(jobs), make, missing)) < len(missing))


def make(work: Path, case: Case) -> None:
    """Simulate a case and write it."""
    plan, size = plan_of(case)
    runs = simulated(case, plan)
    write_runs(case_folder(work, case.name), plan, runs)
    write(truth_file(work, case.name), _truth(case, plan, size, runs))


def make_twin(case: Case, folder: Path) -> None:
    """Write the case as it would be without its extra law: same motion, same noise."""
    plan = replace(plan_of(case)[0], laws=())
    write_runs(folder, plan, simulated(case, plan))


def simulated(case: Case, plan: Plan) -> dict[str, Run]:
    """The recorded runs of a case."""
    seed = int(case.rng("noise").integers(2**31))
    return record(plan, move(plan, seed), seed)


def plan_of(case: Case) -> tuple[Plan, MotionScale]:
    """The plan with everything hidden in it, and how much each joint works."""
    plan = random_plan(case.robot, case.rng("robot"), case.base, case.noise)
    rng = case.rng("hidden")
    joints = [str(rng.choice(plan.robot.joints)) for _ in range(2)]
    hidden: list[EffectValue] = []
    for name, joint in zip(case.effects, joints, strict=False):
        where = joint if EFFECTS[name].scope in ("joint", "episode") else None
        if any(EFFECTS[other].beside in case.effects for other in case.effects):
            where = joints[0]  # Stribeck friction is only sought given Coulomb friction
        hidden.append(draw(name, where, plan, case.noise, rng, around=case.kind == "limit"))
    replaced = {(EFFECTS[e.effect].replaces, e.joint) for e in hidden}
    known = [e for e in plan.model.effects if (e.effect, e.joint) not in replaced]
    plan = replace(plan, model=replace(plan.model, effects=(*known, *hidden)))
    size = motion_scale(plan)
    if case.extra_law:
        i = plan.robot.joints.index(joints[0])
        plan = replace(plan, laws=((joints[0], EXTRA_LAWS[case.extra_law](place(plan, i, size, rng))),))
    return plan, size


def write_runs(folder: Path, plan: Plan, runs: dict[str, Run]) -> None:
    """Write the set of recorded runs, without what only a simulation knows."""
    tables = [
        GroupTable(g.name, g.trajectory, g.payload, run.time, run.theta, run.tau, validation=g.validation)
        for g in plan.groups
        for run in (runs[g.name],)
    ]
    write_set(
        folder,
        robot=plan.source,
        joints=plan.robot.joints,
        groups=tables,
        payloads=plan.payloads,
        torque_hold=runs[plan.groups[0].name].torque_hold,
        initial_stiffness=plan.initial_stiffness,
        initial_motor_inertia=plan.initial_motor_inertia,
        effects=plan.effects,
        files=plan.files,
        overwrite=True,
    )


def base_truth(case: Any, plan: Plan, hidden: list[Json]) -> Json:
    """What the truth files of all studies have: the case, its robot's values and what is hidden in it."""
    model = plan.model
    return {
        "case": case.name,
        "robot": case.robot,
        "joints": list(plan.robot.joints),
        "seed": case.seed,
        "effects": hidden,
        "stiffness": model.stiffness.tolist(),
        "motor_inertia": model.motor_inertia.tolist(),
        "viscous_link": model.link_viscous_friction.tolist(),
        "viscous_motor": model.motor_viscous_friction.tolist(),
        "inertial": model.inertial.tolist(),
    }


def _truth(case: Case, plan: Plan, size: MotionScale, runs: dict[str, Run]) -> Json:
    effects, known = plan.model.effects, len(plan.model.effects) - len(case.effects)
    tau = np.concatenate([run.tau for run in runs.values()])
    hidden = [_hidden(e, plan, size) for e in effects[known:]]
    for joint, law in plan.laws:
        entry = {"effect": "unknown", "joint": joint, "parameters": asdict(law), "kind": case.extra_law}  # type: ignore[call-overload]
        hidden.append(entry | {"payload": None, "group": None})
    return base_truth(case, plan, hidden) | {
        "kind": case.kind,
        "noise_scale": case.noise,
        "base": list(case.base),
        "noise": {"theta": plan.sensors.theta_noise, "tau": plan.sensors.torque_noise},
        "base_effects": [asdict(e) for e in effects[:known]],
        "torque_rms": np.sqrt(np.mean(tau**2, axis=0)).tolist(),
        "residual_ratio": None,
        "weak": False,
    }


def _hidden(effect: EffectValue, plan: Plan, size: MotionScale) -> Json:
    return asdict(effect) | {
        "parameters": {k: v for k, v in effect.parameters.items() if k not in UNSCORED},
        "kind": effect.effect,
        "all_parameters": dict(effect.parameters),
        "size": abs(effect.parameters[SIZES[effect.effect].parameter]),
        "natural": natural(effect.effect, effect.joint, plan, size),
    }
