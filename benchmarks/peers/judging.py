"""One method's answer against the truth, and on the runs that no method has fitted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.peers.problem import COULOMB
from benchmarks.real import held_out_share
from flexviz.analysis.estimation.base_inertials import base_parameters
from flexviz.base.statistics import NORMAL_95
from flexviz.data.measurements import MeasurementSet
from flexviz.model.equation import INERTIAL_NAMES, LinkDynamics
from flexviz.robot.model import EffectValue, FlexibleModel
from flexviz.robot.robot import Robot

RIGID = 1e12  # [Nm/rad] stiffness of a rigid model, in the equation that judges it
FLOOR = 0.1  # errors are relative to the truth, or to this share of the largest of its kind if that is more
SINGLE = (
    ("stiffness", "K", "stiffness"),
    ("motor inertia", "B", "motor_inertia"),
    ("viscous friction", "f_l+f_m", "viscous_friction_sum"),
    ("Coulomb friction", "f_c", f"{COULOMB}.coulomb"),
)
KINDS = (*(kind for kind, *_ in SINGLE), "link inertia")


@dataclass(frozen=True)
class Quantity:
    """What is compared: a parameter, or a combination of inertial ones and motor inertias.

    Attributes:
        kind: of `KINDS`.
        name: for tables.
        weights: (10n + n,) of Γ and B; None where it is no combination of them.
        joint: index, where it belongs to one.
        parameter: flexviz's name of it, for its standard error.
    """

    kind: str
    name: str
    weights: np.ndarray | None = None
    joint: int | None = None
    parameter: str = ""


def quantities(robot: Robot, coulomb: bool, inertias: bool) -> list[Quantity]:
    """All of one set, base parameters of the links included if their truth is known."""
    n = robot.n
    found = []
    for kind, symbol, parameter in SINGLE[: 4 if coulomb else 3]:
        for j, joint in enumerate(robot.joints):
            weights = np.eye(11 * n)[10 * n + j] if kind == "motor inertia" else None
            found.append(Quantity(kind, f"{symbol} {j + 1}", weights, j, f"{parameter}:{joint}"))
    if not inertias:
        return found
    base = base_parameters(robot)
    unseen = rigid_null_space(robot)
    for name, column, row in zip(base.names, base.columns, base.matrix, strict=True):
        label = f"{INERTIAL_NAMES[column % 10]} {column // 10 + 1}"
        label += "R" if np.count_nonzero(row) > 1 else ""
        weights = np.concatenate([row, np.zeros(n)])
        found.append(Quantity("link inertia", label, weights, None, name))
        if not determined(weights, unseen):
            extra = np.linalg.lstsq(unseen[10 * n :].T, -unseen.T @ weights, rcond=1e-9)[0]
            weights = weights + np.concatenate([np.zeros(10 * n), extra])
            names = " + ".join(f"B {j + 1}" for j in np.flatnonzero(np.abs(extra) > 1e-6))
            if determined(weights, unseen):
                found.append(Quantity("link inertia", f"{label} + {names}", weights))
    return found


def rigid_null_space(robot: Robot) -> np.ndarray:
    """(11n, k) directions of Γ and B that no motion of a rigid robot shows."""
    n = robot.n
    q, v, a = np.random.default_rng(0).uniform(-2.5, 2.5, (3, 20 * n, n))
    y = np.concatenate([LinkDynamics(robot).regressor(q, v, a), a[:, :, None] * np.eye(n)], axis=2)
    _, values, right = np.linalg.svd(y.reshape(-1, 11 * n))
    return right[int((values > 1e-9 * values[0]).sum()) :].T


def determined(weights: np.ndarray, unseen: np.ndarray) -> bool:
    """Whether a rigid model has a value for this combination."""
    return bool(np.abs(weights @ unseen).max(initial=0.0) < 1e-6 * np.linalg.norm(weights))


def value(quantity: Quantity, answer: dict[str, Any], unseen: np.ndarray | None = None) -> float | None:
    """What the answer (or the truth, in the same form) says of it; None where it says nothing."""
    rigid = answer["stiffness"] is None
    if quantity.weights is not None:
        if rigid and unseen is not None and not determined(quantity.weights, unseen):
            return None
        n = len(answer["motor_inertia"])
        links = np.zeros(10 * n) if answer["inertial"] is None else np.ravel(answer["inertial"])
        gamma = np.concatenate([links, answer["motor_inertia"]])
        return float(quantity.weights @ gamma)
    j = quantity.joint
    if quantity.kind == "stiffness":
        return None if rigid else answer["stiffness"][j]
    if quantity.kind == "viscous friction":
        return answer["link_viscous_friction"][j] + answer["motor_viscous_friction"][j]
    at_joint = [e for e in answer["effects"] if e["effect"] == COULOMB and e["joint"] == answer["joints"][j]]
    return at_joint[0]["parameters"]["coulomb"] if at_joint else 0.0 if "effects" in answer else None


@dataclass(frozen=True)
class Judged:
    """One quantity of one answer.

    Attributes:
        quantity: which.
        truth: in SI units.
        error: relative; None where the answer says nothing.
        noise: half the 95 % interval that flexviz states, relative; zero for the others.
        undetermined: whether the program itself says that the data do not determine it.
    """

    quantity: Quantity
    truth: float
    error: float | None
    noise: float
    undetermined: bool = False


def errors(robot: Robot, truth: dict[str, Any], answer: dict[str, Any]) -> list[Judged]:
    """Each quantity of an answer beside the truth."""
    coulomb = any(e["effect"] == COULOMB for e in truth["effects"])
    compared = quantities(robot, coulomb, truth["inertial"] is not None)
    unseen = rigid_null_space(robot)
    true = [float(value(q, truth) or 0.0) for q in compared]
    rows = []
    for quantity, right in zip(compared, true, strict=True):
        unit = unit_of(quantity)
        largest = max(abs(t) for q, t in zip(compared, true, strict=True) if unit_of(q) == unit)
        found = value(quantity, {**answer, "joints": robot.joints}, unseen)
        size = max(abs(right), FLOOR * largest)
        share = None if found is None else abs(found - right) / size
        noise = NORMAL_95 * answer.get("std", {}).get(quantity.parameter, 0.0) / size
        doubted = quantity.parameter in answer.get("undetermined", ())
        rows.append(Judged(quantity, right, share, noise, doubted))
    return rows


def unit_of(quantity: Quantity) -> str:
    """Quantities of one kind and unit share the floor of their errors."""
    return quantity.kind + (quantity.name[0] if quantity.kind == "link inertia" else "")


def held_out(measurements: MeasurementSet, answer: dict[str, Any]) -> np.ndarray:
    """(n,) rms of the torque that the model does not explain ÷ the torque's spread, on the held-out runs."""
    n = measurements.robot.n
    rigid = answer["stiffness"] is None
    model = FlexibleModel(
        joints=measurements.joints,
        stiffness=np.full(n, RIGID) if rigid else np.array(answer["stiffness"]),
        motor_inertia=np.array(answer["motor_inertia"]),
        link_viscous_friction=np.array(answer["link_viscous_friction"]),
        motor_viscous_friction=np.array(answer["motor_viscous_friction"]),
        inertial=np.array(answer["inertial"]),
        effects=tuple(EffectValue(**effect) for effect in answer["effects"]),
    )
    return held_out_share(measurements, model)
