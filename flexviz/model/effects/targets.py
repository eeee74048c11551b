"""What a format of an export makes of an effect."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass


@dataclass(frozen=True)
class Written:
    """An effect that a format contains: its representation, and the part that is not reproduced, a clause."""

    meaning: str
    _: KW_ONLY
    missing: str = ""


@dataclass(frozen=True)
class LeftOut:
    """An effect that a format does not contain: the reason, and what to do instead, clauses."""

    because: str
    remedy: str = ""


ServoTargets = Mapping[str, Written | LeftOut]
"""Format of a servo's export -> what it makes of an effect."""

NO_CONTROLLER = "a URDF has no controllers"
NO_LAW = "a BAM servo has no such law"
OWN_VELOCITY = "friction of a URDF joint is dry and viscous only"
STEPPED = "the Python file next to the model adds it in every step"  # of MuJoCo


def not_held(remedy: str, *, isaac: str, bam: str = "") -> ServoTargets:
    """Of a part of the servo's law that only MuJoCo has."""
    return {
        "isaac": LeftOut(isaac, remedy),
        "bam": LeftOut(bam or NO_LAW, remedy),
        "urdf": LeftOut(NO_CONTROLLER, remedy),
    }
