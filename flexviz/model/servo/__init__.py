"""Joints that follow goals: the firmware's law, and the free motion that follows from it."""

from flexviz.model.servo.driven_motion import DrivenMotion, driven_motion
from flexviz.model.servo.free_motion import TURN, free_motion
from flexviz.model.servo.parameters import (
    ABSENT,
    CENTER,
    INDEX,
    LOG,
    NAMES,
    OWN,
    PARAMETERS,
    RIVALS,
    SCALED,
    SERVO_EFFECTS,
    SHARED,
    SIZE,
    SPREAD,
    START,
    TORQUE,
    absent,
    of_effect,
)

__all__ = [
    "ABSENT",
    "CENTER",
    "INDEX",
    "LOG",
    "NAMES",
    "OWN",
    "PARAMETERS",
    "RIVALS",
    "SCALED",
    "SERVO_EFFECTS",
    "SHARED",
    "SIZE",
    "SPREAD",
    "START",
    "TORQUE",
    "TURN",
    "DrivenMotion",
    "absent",
    "driven_motion",
    "free_motion",
    "of_effect",
]
