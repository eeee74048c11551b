"""`mujoco.sysid`: trajectories simulated with finite differences on K, B, friction and link inertias.

Each elastic joint is two hinges, rotor (armature B) and link, coupled by a tendon of stiffness K. The
measured torque drives the rotors; a soft servo on the measured angle keeps the simulation on the motion.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

from benchmarks.peers.derivatives import DROPPED, differences, smooth, torque_at_samples
from benchmarks.peers.problem import COULOMB, Array, Group, Problem, answer

mujoco: Any = import_module("mujoco")
sysid: Any = import_module("mujoco.sysid")
import_module("mujoco.sysid._src.parameter")  # fails where the extra packages of mujoco[sysid] are absent

STEP = 0.002  # [s] of the simulation
HERTZ = 20.0  # of the filter for the servo's reference velocity and for the state at the start
SERVO = 10.0  # [rad/s]
FRICTION = 0.5  # [Nm s/rad] at the start
COULOMB_SHARE = 0.1  # of the torque's spread, at the start
WEIGHT = 1e4  # of the residual, so that the optimiser's regularisation is small beside it
ITERATIONS = 30
TOLERANCE = 1e-4  # a step this small, relative to the start values, ends the search


def specification(problem: Problem, group: Group) -> Any:
    """The arm with its rotors, their springs, and the group's payload."""
    spec = mujoco.MjSpec.from_file(str(problem.urdf))
    spec.compile()  # merges fixed links; the payload must stay a body of its own
    spec.compiler.fusestatic = False
    spec.option.timestep, spec.option.integrator = STEP, mujoco.mjtIntegrator.mjINT_RK4
    spec.compiler.autolimits = False
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_LIMIT | mujoco.mjtDisableBit.mjDSBL_CONTACT
    for i, (joint, link) in enumerate(zip(problem.joints, problem.links, strict=True)):
        hinge, body = spec.joint(joint), spec.body(link)
        hinge.limited = hinge.actfrclimited = 0
        rotor = body.parent.add_body(name=f"rotor{i}", pos=body.pos, quat=body.quat)
        rotor.mass, rotor.inertia, rotor.explicitinertial = 1e-6, [1e-6] * 3, True
        rotor.add_joint(name=f"motor{i}", axis=hinge.axis, armature=problem.motor_inertia[i])
        tendon = spec.add_tendon(name=f"spring{i}", springlength=[0, 0])
        tendon.wrap_joint(f"motor{i}", 1)
        tendon.wrap_joint(joint, -1)
        kp, kd = gains(problem)[:, i]
        spec.add_actuator(
            name=f"drive{i}", target=f"motor{i}", trntype=mujoco.mjtTrn.mjTRN_JOINT,
            biastype=mujoco.mjtBias.mjBIAS_AFFINE, biasprm=[0, -kp, -kd] + [0] * 7,
        )  # fmt: skip
        spec.add_sensor(
            name=f"angle{i}", type=mujoco.mjtSensor.mjSENS_JOINTPOS,
            objtype=mujoco.mjtObj.mjOBJ_JOINT, objname=f"motor{i}",
        )  # fmt: skip
        if group.payload[i, 0]:
            set_inertial(body.add_body(name=f"payload{i}"), group.payload[i])
    return spec


def gains(problem: Problem) -> Array:
    """(2, n) of the servo."""
    inertia = 2 * problem.motor_inertia
    return np.array([inertia * SERVO**2, 2 * inertia * SERVO])


def set_inertial(body: Any, row: Array) -> None:
    """Mass, centre and inertia of a body from its parameters about the joint's frame."""
    mass, centre = row[0], row[1:4] / row[0]
    about = np.array([[row[4], row[5], row[7]], [row[5], row[6], row[8]], [row[7], row[8], row[9]]])
    own = about - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre)) + 1e-9 * np.eye(3)
    body.explicitinertial, body.mass, body.ipos, body.iquat = True, mass, centre, [1, 0, 0, 0]
    body.inertia = [0, 0, 0]
    body.fullinertia = [own[0, 0], own[1, 1], own[2, 2], own[0, 1], own[0, 2], own[1, 2]]


def parameters(problem: Problem, spec: Any) -> Any:
    """Joint parameters relative to their start; all ten inertial parameters per link as a pseudo-inertia."""
    found, model = sysid.ParameterDict(), spec.compile()

    def add(name: str, start: float, change: Callable[[Any, float], None]) -> None:
        def modifier(s: Any, parameter: Any) -> None:
            change(s, start * parameter.value[0])

        found.add(sysid.Parameter(name, [1.0], min_value=[0.01], max_value=[20.0], modifier=modifier))

    def joint(name: str, attribute: str) -> Callable[[Any, float], None]:
        return lambda s, value: setattr(s.joint(name), attribute, value)

    for i, (name, link) in enumerate(zip(problem.joints, problem.links, strict=True)):
        k, b, tendon = problem.stiffness[i], problem.motor_inertia[i], f"spring{i}"
        add(f"K{i}", k, lambda s, x, t=tendon: setattr(s.tendon(t), "stiffness", [x, 0, 0]))
        add(f"B{i}", b, joint(f"motor{i}", "armature"))
        for key, place in (("fm", f"motor{i}"), ("fl", name)):
            add(f"{key}{i}", FRICTION, lambda s, x, p=place: setattr(s.joint(p), "damping", [x, 0, 0]))
        if COULOMB in problem.effects:
            add(f"fc{i}", coulomb_start(problem)[i], joint(f"motor{i}", "frictionloss"))
        kind = sysid.InertiaType.Pseudo
        found.add(
            sysid.body_inertia_param(spec, model, link, inertia_type=kind, modifier=pseudo_inertia(link))
        )
    return found


def coulomb_start(problem: Problem) -> Array:
    """(n,) [Nm]"""
    return COULOMB_SHARE * np.concatenate([group.tau for group in problem.fitted]).std(axis=0)


def joint_values(problem: Problem, given: Any) -> list[Array]:
    """K, B, f_l, f_m and, if it is in the model, f_c, (n,) each."""
    start = {"K": problem.stiffness, "B": problem.motor_inertia, "fc": coulomb_start(problem)}
    keys = [key for key in ("K", "B", "fl", "fm", "fc") if f"{key}0" in given]
    return [
        start.get(key, np.full(problem.n, FRICTION))
        * np.array([given[f"{key}{i}"].value[0] for i in range(problem.n)])
        for key in keys
    ]


def pseudo_inertia(link: str) -> Callable[[Any, Any], None]:
    """The toolbox's own modifier, which MuJoCo 4.0.0 refuses to compile without an orientation."""

    def modifier(spec: Any, parameter: Any) -> None:
        sysid.apply_body_inertia(spec, link, parameter)
        spec.body(link).iquat = [1, 0, 0, 0]

    return modifier


def sequence(problem: Problem, group: Group, spec: Any) -> tuple[Any, Array]:
    """What drives the simulation and what it is compared with; θ, θ̇, θ̈, θ⃛, τ, τ̇ at the start (6, n)."""
    model, step = spec.compile(), group.step
    derivatives = differences(smooth(group.theta, HERTZ, step), 3, step)
    torque = torque_at_samples(group, problem.hold)
    kp, kd = gains(problem)
    drive = torque + kp * derivatives[0] + kd * derivatives[1]
    first = round(DROPPED / step)
    times = np.arange(group.time[first], group.time[-first], STEP)

    def at(signal: Array, shift: float = 0.0) -> Array:
        return np.stack([np.interp(times + shift, group.time, c) for c in signal.T], axis=1)

    control = sysid.TimeSeries.from_control_names(times, at(drive, STEP / 2), model)
    # as a state: what a sensor reads is labelled one step late by the rollout
    names = [(f"motor{i}", sysid.SignalType.MjStateQPos) for i in range(problem.n)]
    measured = sysid.TimeSeries.from_names(times, at(group.theta), model, names)
    smoothed = differences(smooth(torque, HERTZ, step), 1, step)
    state = np.zeros(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS.value))
    state[0] = times[0]
    made = sysid.ModelSequences(group.name, spec, group.name, state, control, measured)
    return made, np.array([x[first] for x in (*derivatives, *smoothed)])


def rollout_from(problem: Problem, start: Array) -> Callable[..., Any]:
    """A rollout whose links start where the candidate's own spring and motor put them: q = θ − s/K."""
    theta, rate, second, third, torque, slope = start

    def rollout(initial_states: Any, param_dicts: Any, models: Any, **rest: Any) -> Any:
        states = []
        for state, given, model in zip(initial_states, param_dicts, models, strict=True):
            k, b, _, motor, *_ = joint_values(problem, given)
            q = theta - (torque - b * second - motor * rate) / k
            v = rate - (slope - b * third - motor * second) / k
            names = [*(f"motor{i}" for i in range(problem.n)), *problem.joints]
            whole = sysid.create_initial_state(
                model, np.concatenate([theta, q]), np.concatenate([rate, v]), None,
                [f"{name}_qpos" for name in names], [f"{name}_qvel" for name in names],
            )  # fmt: skip
            whole[0] = state[0]
            states.append(whole)
        return sysid.sysid_rollout(models=models, initial_states=states, **rest)

    return rollout


def estimate(problem: Problem) -> dict[str, Any]:
    """The package's own optimiser."""
    specs = [specification(problem, group) for group in problem.fitted]
    functions = []
    for group, spec in zip(problem.fitted, specs, strict=True):
        made, start = sequence(problem, group, spec)
        rollout = rollout_from(problem, start)
        functions.append(
            # at the simulation's own instants: resampling adds a step to some lengths, which is a drift
            sysid.build_residual_fn(
                models_sequences=[made], custom_rollout=rollout, resample_true=False, n_threads=1
            )
        )
    evaluations, diverged, latest = 0, 0, []

    def residual(x: Array, params: Any) -> Any:
        nonlocal evaluations, diverged
        evaluations += 1 if x.ndim == 1 else x.shape[1]
        try:
            residuals, *rest = zip(*[function(x, params) for function in functions], strict=True)
        except (
            ValueError
        ):  # MuJoCo starts again where a candidate diverges; the optimiser steps back from NaN
            diverged += 1
            if not latest:
                raise FloatingPointError("its simulation diverges at the start values") from None
            return [np.full((len(r), *x.shape[1:]), np.nan) for r in latest], [], []
        latest[:] = [WEIGHT * r for part in residuals for r in part]
        return latest.copy(), *rest

    found, _ = sysid.optimize(
        parameters(problem, specs[0]), residual, max_iters=ITERATIONS, xtol=TOLERANCE, verbose=False
    )
    if diverged:
        raise FloatingPointError("stopped early: candidates diverge in its simulation")
    k, b, link, motor, *coulomb = joint_values(problem, found)
    final = sysid.apply_param_modifiers_spec(found, specs[0])
    return answer(
        problem,
        stiffness=k,
        motor_inertia=b,
        viscous=(link, motor),
        inertial=np.array([inertial_of(final.body(link)) for link in problem.links]),
        coulomb=coulomb[0] if coulomb else None,
        evaluations=evaluations,
    )


def inertial_of(body: Any) -> Array:
    """The ten parameters about the joint's frame."""
    i = body.fullinertia
    own = np.array([[i[0], i[3], i[4]], [i[3], i[1], i[5]], [i[4], i[5], i[2]]])
    if not np.isfinite(own).all():
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, body.iquat)
        own = rotation.reshape(3, 3) @ np.diag(body.inertia) @ rotation.reshape(3, 3).T
    m, c = body.mass, np.array(body.ipos)
    about = own + m * (c @ c * np.eye(3) - np.outer(c, c))
    upper = about[0, 0], about[0, 1], about[1, 1], about[0, 2], about[1, 2], about[2, 2]
    return np.array([m, *(m * c), *upper])
