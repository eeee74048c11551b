"""How a robot is mounted: gravity in its base's frame, and the base in a frame with z up."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from flexviz.base.arrays import Array
from flexviz.base.errors import InputError

GRAVITY = (0.0, 0.0, -9.81)  # [m/s²] of a robot that stands upright
LEAST, LARGEST = 1.5, 30.0  # [m/s²]; less than on the Moon is a direction without its size
DIRECTIONS = {
    "−z: upright": GRAVITY,
    "+z: under a ceiling": (0.0, 0.0, 9.81),
    "+x: on a wall": (9.81, 0.0, 0.0),
    "−x: on a wall": (-9.81, 0.0, 0.0),
    "+y: on a wall": (0.0, 9.81, 0.0),
    "−y: on a wall": (0.0, -9.81, 0.0),
}
"""The axis of the base along which things fall -> gravity [m/s²]."""


def check_gravity(value: Any) -> None:
    """ValueError where a gravity is impossible, with what is expected."""
    if not (isinstance(value, list | tuple) and len(value) == 3 and all(map(_is_finite, value))):
        raise ValueError(
            "expected three finite numbers, gravity [m/s²] in the base's frame: [0, 0, -9.81] if upright"
        )
    size = math.hypot(*value) if max(map(abs, value)) <= LARGEST else math.inf
    if size != 0.0 and not LEAST <= size <= LARGEST:
        length = f"a length of {size:.3g} m/s²" if size < math.inf else f"a component above {LARGEST:g} m/s²"
        raise ValueError(f"{length}, expected {LEAST:g} to {LARGEST:g} (9.81 on Earth), or 0 without gravity")


def _is_finite(x: Any) -> bool:
    return isinstance(x, int | float) and not isinstance(x, bool) and abs(x) < math.inf


def checked_gravity(value: Sequence[float], place: str) -> tuple[float, float, float]:
    """A stated gravity (3,) [m/s²]; InputError that names `place` where it is impossible."""
    try:
        check_gravity(value)
    except ValueError as error:
        raise InputError(f"found {', '.join(map(str, value))}: {error}", place=place) from None
    x, y, z = map(float, value)
    return x, y, z


def upright(gravity: Sequence[float] | Array) -> Array:
    """Rotation (3, 3) from the base's frame to one whose z points up, the shortest one.

    Under a ceiling it turns about x; without gravity the base stays as it is.
    """
    size = float(np.linalg.norm(gravity))
    up = -np.asarray(gravity, dtype=float) / size if size > 0.0 else np.array([0.0, 0.0, 1.0])
    if up[2] < -1.0 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    x, y, z = up
    cross = np.array([[0.0, 0.0, -x], [0.0, 0.0, -y], [x, y, 0.0]])  # of up × e_z
    return np.eye(3) + cross + cross @ cross / (1.0 + z)


def gravity_text(gravity: Sequence[float]) -> str:
    """`gravity = [9.81, 0, 0]`, as in a measurement set."""
    return f"gravity = [{', '.join(f'{x:.6g}' for x in gravity)}]"
