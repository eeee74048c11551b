"""What the tests of the exports share: short sets, models with effects, a motion with exact derivatives."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexviz.content.results import ResultDocument
from flexviz.data.measurements import MeasurementSet, read_set
from flexviz.model.effects import EFFECTS, JointMotion, LawEffect
from flexviz.model.effects.elastic_joint import hardened
from flexviz.model.simulation import Plan, inject, make_plan, simulate_plan, write_plan
from flexviz.model.simulation.sets import true_effects, true_parameters
from flexviz.outlets.exporting import IdentifiedRobot, identified_robot
from flexviz.robot._pinocchio import pin
from flexviz.robot.model import FlexibleModel

Array = NDArray[np.float64]
SAMPLES = 1024
PERIOD = 4.0  # [s]
HARMONICS = 160  # of the period that are kept when a signal is differentiated


@cache
def plan(preset: str, *hidden: str) -> Plan:
    """A preset's plan with effects in it."""
    return inject(make_plan(preset), hidden)


def short_set(preset: str, folder: Path) -> MeasurementSet:
    """A set of a preset with one short group, written and read."""
    made = make_plan(preset)
    made = replace(made, groups=(replace(made.groups[0], duration=0.1),))
    return read_set(write_plan(made, simulate_plan(made), folder / preset))


def document(model: FlexibleModel, **more: Any) -> ResultDocument:
    """A model as a result, as if every value had been found."""
    known = {"std": 1e-3, "identifiable": "yes"}
    turning = [False] * model.n
    values = [p | known for p in true_parameters(model, turning)]
    return ResultDocument.model_validate(
        {"format": 1, "set": "made", "parameters": values, "effects": true_effects(model, turning)} | more
    )


def identified(
    measurements: MeasurementSet, model: FlexibleModel, payload: str | None = None, **more: Any
) -> IdentifiedRobot:
    """A model as an export takes it."""
    return identified_robot(measurements, document(model, **more), payload=payload)


def motion(n: int, seed: int = 0) -> tuple[Array, Array]:
    """Time (N,) and a periodic motion of n joints with four derivatives, (5, N, n) [rad/s^k]."""
    rng = np.random.default_rng(seed)
    time = PERIOD * np.arange(SAMPLES) / SAMPLES
    out = np.zeros((5, SAMPLES, n))
    out[0] += rng.uniform(-0.5, 0.5, n)
    for harmonic in (1, 2):
        omega, size, phase = 2 * np.pi * harmonic / PERIOD, *rng.uniform((0.2, 0.0), (0.5, 6.0), (n, 2)).T
        for k in range(5):
            out[k] += size / harmonic * omega**k * np.sin(omega * time[:, None] + phase + k * np.pi / 2)
    return time, out


def differentiated(x: Array, order: int) -> Array:
    """The derivative of a periodic signal (N, n), to rounding where it has no more than `HARMONICS`."""
    spectrum = np.fft.rfft(x, axis=0)
    spectrum[HARMONICS:] = 0.0
    factor = (2j * np.pi * np.arange(len(spectrum)) / PERIOD) ** order
    return np.fft.irfft(spectrum * factor[:, None], len(x), axis=0)


def library_link_torque(made: IdentifiedRobot, q: Array) -> Array:
    """(N, n) what Pinocchio says the links take for a motion (5, N, n), with viscous friction [Nm]."""
    robot = made.robot
    model = robot.model_with(made.model.inertial, made.laws.bodies, made.laws.gravity)
    data = model.createData()
    rows = [np.ascontiguousarray(robot.to_pin(x)) for x in q[:3]]
    torque = np.array([pin.rnea(model, data, *row).copy() for row in zip(*rows, strict=True)])
    return robot.from_pin(torque) + made.model.link_viscous_friction * q[1]


def library_motor_torque(made: IdentifiedRobot, time: Array, q: Array, theta: Array, load: Array) -> Array:
    """(N, n) motor torque by the effects' own laws [Nm], for the motors' motion theta (3, N, n)."""
    model = made.model
    torque = load + model.motor_inertia * theta[2] + model.motor_viscous_friction * theta[1]
    gain = np.ones(made.robot.n)
    for effect in model.effects:
        i = 0 if effect.joint is None else model.joints.index(effect.joint)
        law, values = EFFECTS[effect.effect], np.array(list(effect.parameters.values()))
        if law.where == "motor" and isinstance(law, LawEffect):
            torque[:, i] += law.law(seen(model, i, time, q, theta, load), values)[0]
        elif effect.effect == "motor_coupling":
            torque[:, i] += values[0] * theta[2][:, i + 1 if i + 1 < model.n else i - 1]
        elif effect.effect == "coupled_friction":
            other = i + 1 if i + 1 < model.n else i - 1
            both = theta[1][:, i] + theta[1][:, other]
            torque[:, [i, other]] += (values[0] * np.tanh(both / 0.005) + values[1] * both)[:, None]
        elif effect.effect == "torque_gain":
            gain[i] += values[0]
    return torque / gain


def seen(model: FlexibleModel, i: int, time: Array, q: Array, theta: Array, load: Array) -> JointMotion:
    """Joint i's motion as an effect of the library sees it."""
    return JointMotion(
        time=time,
        position=theta[0][:, i],
        velocity=theta[1][:, i],
        torque=load[:, i],
        link_position=q[0][:, i],
        link_velocity=q[1][:, i],
        stiffness=float(model.stiffness[i]),
        motor_viscous=float(model.motor_viscous_friction[i]),
        torque_scale=1.0,
    )


def deflections(made: IdentifiedRobot, load: Array) -> Array:
    """(N, n) deflection of the library's elastic law at the torque `load` (N, n)."""
    laws = made.laws
    columns = zip(load.T, laws["stiffness"], laws["cubic"], strict=True)
    return np.stack([hardened(torque, float(k), float(k3)) for torque, k, k3 in columns], axis=1)
