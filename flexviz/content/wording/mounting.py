"""How a robot is mounted."""

from __future__ import annotations

from collections.abc import Sequence

from flexviz.robot.mounting import GRAVITY, gravity_text, upright

SLIGHT = 0.02  # of the cosine of the base's tilt, to call it upright or horizontal


def mounting_text(gravity: Sequence[float]) -> str:
    """How the base is mounted: "on a wall, gravity = [9.81, 0, 0] m/s² in the base's frame".

    "" for the usual gravity.
    """
    if tuple(gravity) == GRAVITY:
        return ""
    up = float(upright(gravity)[2, 2])  # cosine of the angle between the base's z and up
    places = {
        "without gravity": not any(gravity),
        "upright": up > 1.0 - SLIGHT,
        "on a wall": abs(up) < SLIGHT,
    }
    places |= {"under a ceiling": up < SLIGHT - 1.0, "tilted": True}
    place = next(name for name, here in places.items() if here)
    return f"{place}, {gravity_text(gravity)} m/s² in the base's frame"
