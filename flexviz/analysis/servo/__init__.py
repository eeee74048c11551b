"""Joints that follow goals: estimated, diagnosed and judged by their free motion from the goals alone."""

from flexviz.analysis.servo.judge import FreeRun, TrajectoryJudge
from flexviz.analysis.servo.pipeline import diagnose_servos, identify_servos

__all__ = ["FreeRun", "TrajectoryJudge", "diagnose_servos", "identify_servos"]
