"""Friction and elasticity as CSV tables for feed-forward: written from a model, read by a controller."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flexviz.base.arrays import Array
from flexviz.base.errors import InputError, choose_from
from flexviz.base.limits import check_size
from flexviz.model.compensation.friction import deflection, sliding_friction
from flexviz.robot.model import FlexibleModel

FRICTION_FILE, ELASTICITY_FILE = "friction.csv", "elasticity.csv"
COLUMNS = ("joint", "velocity", "friction", "per_load_driving", "per_load_driven")
SLOWEST = 5e-4  # [rad/s] first step of the table: a tenth of the width of sign(v)
SPEEDS = 48  # per direction
TORQUES = 81  # of an elasticity
LARGEST = 2**24  # [bytes]


@dataclass(frozen=True, eq=False)
class FrictionTable:
    """Friction of the joints by speed and load, interpolated linearly and held beyond its ends.

    friction(v, s) = friction(v) + |s| · per_load(v), with one column for s v > 0, where the motor drives, and
    one for s v ≤ 0, where the load does.

    Attributes:
        joints: names of the n joints.
        rows: of each joint (M, 4): velocity [rad/s], friction [Nm], both columns per load [-].
    """

    joints: tuple[str, ...]
    rows: tuple[Array, ...]

    def torque(self, velocity: Array, load: Array) -> Array:
        """Torque (…, n) [Nm] at `velocity` (…, n) [rad/s] and joint torque `load` (…, n) [Nm]."""
        out = np.empty(np.shape(velocity))
        for j, table in enumerate(self.rows):
            v, s = velocity[..., j], load[..., j]
            plain, driving, driven = (np.interp(v, table[:, 0], table[:, k]) for k in (1, 2, 3))
            out[..., j] = plain + np.abs(s) * np.where(s * v > 0, driving, driven)
        return out

    @property
    def text(self) -> str:
        """The table as CSV."""
        rows = (
            (joint, *(f"{value:.9g}" for value in row))
            for joint, table in zip(self.joints, self.rows, strict=True)
            for row in table
        )
        return _csv(COLUMNS, rows)


def friction_table(model: FlexibleModel, fastest: Array) -> FrictionTable:
    """Friction of a model up to the speeds `fastest` (n,) [rad/s]."""
    return FrictionTable(
        model.joints, tuple(_of_joint(model, j, float(speed)) for j, speed in enumerate(fastest))
    )


def _of_joint(model: FlexibleModel, j: int, fastest: float) -> Array:
    fastest = max(fastest, 10 * SLOWEST)
    half = np.unique(
        np.concatenate((np.geomspace(SLOWEST, fastest, SPEEDS), np.linspace(SLOWEST, fastest, SPEEDS)))
    )
    v = np.concatenate((-half[::-1], [0.0], half))
    plain = sliding_friction(model, j, v, np.zeros_like(v))
    along, against = (sliding_friction(model, j, v, side * np.sign(v)) - plain for side in (1.0, -1.0))
    return np.stack((v, plain, along, against), axis=1)


def elasticity_text(model: FlexibleModel, largest: Array) -> str:
    """Deflection θ − q by joint torque, up to `largest` (n,) [Nm], as CSV."""
    rows = []
    for j, joint in enumerate(model.joints):
        torque = np.linspace(-largest[j], largest[j], TORQUES)
        bent = deflection(model, j, torque)
        rows += [(joint, f"{s:.9g}", f"{x:.9g}") for s, x in zip(torque, bent, strict=True)]
    return _csv(("joint", "torque", "deflection"), rows)


def _csv(head: Sequence[str], rows: Iterator[Sequence[str]] | Sequence[Sequence[str]]) -> str:
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(rows)
    return out.getvalue()


def read_friction_table(file: str | Path, joints: Sequence[str]) -> FrictionTable:
    """The table in `file` for a robot's joints; a joint without rows is not compensated, # is a comment.

    Raises:
        InputError: naming row and column, and what is expected.
    """
    file = Path(file)
    check_size(file, LARGEST, "a table of friction")
    found: dict[str, list[list[float]]] = {joint: [] for joint in joints}
    try:
        with file.open(encoding="utf-8-sig", newline="") as source:
            reader = enumerate(csv.reader(source), 1)
            rows = ((number, row) for number, row in reader if row and not row[0].startswith("#"))
            _, head = next(rows, (1, []))
            if tuple(head) != COLUMNS:
                message = f"found the columns {', '.join(head) or 'none'}, expected {', '.join(COLUMNS)}"
                raise InputError(message, file=file)
            for number, row in rows:
                joint, values = _row(row, number, joints, file)
                if found[joint] and values[0] <= found[joint][-1][0]:
                    message = f"found {values[0]:g} after {found[joint][-1][0]:g}, expected a larger velocity"
                    raise InputError(message, file=file, place=f"row {number}, column velocity")
                found[joint].append(values)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"cannot be read ({getattr(error, 'strerror', None) or error})", file=file) from None
    if not any(found.values()):
        raise InputError("has no rows, expected at least one", file=file)
    return FrictionTable(
        tuple(joints), tuple(np.array(rows) if rows else np.zeros((1, 4)) for rows in found.values())
    )


def _row(row: Sequence[str], number: int, joints: Sequence[str], file: Path) -> tuple[str, list[float]]:
    if len(row) != len(COLUMNS):
        message = f"{len(row)} cells, expected {len(COLUMNS)}"
        raise InputError(message, file=file, place=f"row {number}")
    if row[0] not in joints:
        message = f'joint "{row[0]}" is not in the set; {choose_from(row[0], joints)}'
        raise InputError(message, file=file, place=f"row {number}, column joint")
    values = []
    for name, cell in zip(COLUMNS[1:], row[1:], strict=True):
        try:
            values.append(float(cell))
        except ValueError:
            values.append(math.nan)
        if not math.isfinite(values[-1]):
            message = f'found "{cell}", expected a finite number'
            raise InputError(message, file=file, place=f"row {number}, column {name}")
    return row[0], values
