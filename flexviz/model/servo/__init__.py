"""Joints that follow goals: the firmware's law, and the free motion that follows from it."""

from flexviz.model.servo.driven_motion import BAND, DrivenMotion, driven_motion
from flexviz.model.servo.free_motion import TURN, free_motion
from flexviz.model.servo.model import GAIN, follows_goals, in_newtons, servo_model, servo_values
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
    "BAND",
    "CENTER",
    "GAIN",
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
    "follows_goals",
    "free_motion",
    "in_newtons",
    "of_effect",
    "servo_model",
    "servo_values",
]
