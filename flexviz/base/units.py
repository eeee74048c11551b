"""Units by the kind of a joint: a joint that slides has m and N where one that turns has rad and Nm."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

_OF_SLIDING = (("Nm", "N"), ("rad", "m"), ("kg m²", "kg"))  # also within Nm s/rad, mrad, kNm/rad


def joint_unit(unit: str, slides: bool) -> str:
    """The unit of a quantity of a joint, from that of a joint that turns.

    Not for inertias of bodies, which have kg m² on any joint.

    >>> joint_unit("Nm s/rad", True), joint_unit("mrad", True), joint_unit("kg m²", True)
    ('N s/m', 'mm', 'kg')
    >>> joint_unit("Nm s/rad", False)
    'Nm s/rad'
    """
    if slides:
        for turning, sliding in _OF_SLIDING:
            unit = unit.replace(turning, sliding)
    return unit


def joint_units(unit: str, slides: Iterable[Any]) -> tuple[str, ...]:
    """The unit of a quantity of each joint."""
    return tuple(joint_unit(unit, bool(one)) for one in slides)


def unit_of_all(units: Sequence[str], otherwise: str = "Nm") -> str:
    """What a table states for joints with these units: "Nm", or "N, Nm"; `otherwise` where none is known."""
    return ", ".join(sorted(set(units))) or otherwise
