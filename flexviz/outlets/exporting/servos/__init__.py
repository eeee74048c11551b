"""Formats of a robot whose joints follow goals: the goal is the input of every joint."""

from __future__ import annotations

from collections.abc import Callable

from flexviz.outlets.exporting.identified import FormatFiles, IdentifiedRobot
from flexviz.outlets.exporting.parameters import json_parameters, yaml_parameters
from flexviz.outlets.exporting.servos.bam import bam
from flexviz.outlets.exporting.servos.isaac import isaac_lab
from flexviz.outlets.exporting.servos.mjcf import servo_mjcf
from flexviz.outlets.exporting.urdf import servo_urdf

SERVO_FORMATS: dict[str, Callable[[IdentifiedRobot], FormatFiles]] = {
    "urdf": servo_urdf,
    "mjcf": servo_mjcf,
    "isaac": isaac_lab,
    "bam": bam,
    "yaml": yaml_parameters,
    "json": json_parameters,
}

__all__ = ["SERVO_FORMATS"]
