"""A case becomes a measurement set, and its truth lies elsewhere: the diagnosis never sees it."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.diagnosis_study.cases import Case
from benchmarks.diagnosis_study.laws import EXTRA_LAWS
from benchmarks.diagnosis_study.robots import CYCLE, random_plan
from benchmarks.diagnosis_study.sizes import SIZES, draw, natural
from flexviz.effects import EFFECTS
from flexviz.measurements import GroupTable, write_set
from flexviz.model import EffectValue
from flexviz.simulation import MotionScale, Plan, Run, motion_scale, move, record

UNSCORED = {"phase", "rest_angle", "tilt_x"}  # ambiguous, or relative to nothing


def case_folder(work: Path, name: str) -> Path:
    """The measurement set of a case."""
    return work / "cases" / name


def truth_file(work: Path, name: str) -> Path:
    """What is hidden in a case."""
    return work / "truth" / f"{name}.json"


def is_made(work: Path, case: Case) -> bool:
    """Whether both are there; the truth is written last."""
    return truth_file(work, case.name).is_file() and case_folder(work, case.name).is_dir()


def make(work: Path, case: Case) -> None:
    """Simulate a case and write it."""
    plan, size = plan_of(case)
    seed = int(case.rng("noise").integers(2**31))
    runs = record(plan, move(plan, seed), seed)
    _write(case_folder(work, case.name), plan, runs)
    path = truth_file(work, case.name)
    path.parent.mkdir(parents=True, exist_ok=True)
    text = json.dumps(_truth(case, plan, size, runs), indent=1, ensure_ascii=False)
    temporary = path.with_suffix(".new")
    temporary.write_text(text + "\n", encoding="utf-8")
    temporary.replace(path)


def make_twin(case: Case, folder: Path) -> None:
    """Write the case as it would be without its extra law: same motion, same noise."""
    plan, _ = plan_of(case)
    plan = replace(plan, laws=())
    seed = int(case.rng("noise").integers(2**31))
    _write(folder, plan, record(plan, move(plan, seed), seed))


def plan_of(case: Case) -> tuple[Plan, MotionScale]:
    """The plan with everything hidden in it, and how much each joint works."""
    plan = random_plan(case.robot, case.rng("robot"), case.base, case.noise)
    rng = case.rng("hidden")
    joints = [str(rng.choice(plan.robot.joints)) for _ in range(2)]
    hidden: list[EffectValue] = []
    for name, joint in zip(case.effects, joints, strict=False):
        where = joint if EFFECTS[name].scope in ("joint", "episode") else None
        if any(EFFECTS[other].beside in case.effects for other in case.effects):
            where = joints[0]  # Stribeck friction is only sought beside Coulomb friction
        hidden.append(draw(name, where, plan, case.noise, rng, around=case.kind == "limit"))
    replaced = {(EFFECTS[e.effect].replaces, e.joint) for e in hidden}
    known = [e for e in plan.model.effects if (e.effect, e.joint) not in replaced]
    plan = replace(plan, model=replace(plan.model, effects=(*known, *hidden)))
    size = motion_scale(plan)
    if case.extra_law:
        i = plan.robot.joints.index(joints[0])
        plan = replace(plan, laws=((joints[0], EXTRA_LAWS[case.extra_law](plan, i, size, rng)),))
    return plan, size


def _write(folder: Path, plan: Plan, runs: dict[str, Run]) -> None:
    tables = [
        GroupTable(g.name, g.trajectory, g.payload, runs[g.name].time, runs[g.name].theta, runs[g.name].tau,
                   validation=g.validation)
        for g in plan.groups
    ]  # fmt: skip
    write_set(
        folder,
        robot=plan.source,
        joints=plan.robot.joints,
        groups=tables,
        payloads=plan.payloads,
        torque_hold=CYCLE,
        initial_stiffness=plan.initial_stiffness,
        initial_motor_inertia=plan.initial_motor_inertia,
        effects=plan.effects,
        files=plan.files,
        overwrite=True,
    )


def _truth(case: Case, plan: Plan, size: MotionScale, runs: dict[str, Run]) -> dict[str, Any]:
    """The truth as the scoring script reads it, and with what the study wants to know besides."""
    model, joints = plan.model, list(plan.robot.joints)
    known = len(plan.model.effects) - len(case.effects)
    tau = np.concatenate([run.tau for run in runs.values()])
    hidden = [_hidden(e, plan, size) for e in model.effects[known:]]
    for joint, law in plan.laws:
        entry = {"effect": "unknown", "joint": joint, "parameters": asdict(law), "kind": case.extra_law}  # type: ignore[call-overload]
        hidden.append(entry | {"payload": None, "group": None})
    return {
        "case": case.name,
        "kind": case.kind,
        "robot": case.robot,
        "effects": hidden,
        "seed": case.seed,
        "noise_scale": case.noise,
        "stiffness": model.stiffness.tolist(),
        "motor_inertia": model.motor_inertia.tolist(),
        "viscous_link": model.link_viscous_friction.tolist(),
        "viscous_motor": model.motor_viscous_friction.tolist(),
        "base": list(case.base),
        "noise": {"theta": plan.sensors.theta_noise, "tau": plan.sensors.torque_noise},
        "joints": joints,
        "inertial": model.inertial.tolist(),
        "base_effects": [asdict(e) for e in model.effects[:known]],
        "torque_rms": np.sqrt(np.mean(tau**2, axis=0)).tolist(),
        "residual_ratio": None,
        "weak": False,
    }


def _hidden(effect: EffectValue, plan: Plan, size: MotionScale) -> dict[str, Any]:
    scored = {k: v for k, v in effect.parameters.items() if k not in UNSCORED}
    parameter = SIZES[effect.effect].parameter
    return {
        "effect": effect.effect,
        "joint": effect.joint,
        "parameters": scored,
        "kind": effect.effect,
        "payload": effect.payload,
        "group": effect.group,
        "all_parameters": dict(effect.parameters),
        "size": abs(effect.parameters[parameter]),
        "natural": natural(effect.effect, effect.joint, plan, size),
    }
