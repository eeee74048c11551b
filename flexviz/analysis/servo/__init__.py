"""Joints that follow goals: estimated, diagnosed and judged by their free motion from the goals alone.

The torque of such joints is what their servo's law makes of the goal, and the law is unknown. So the robot is
simulated from the goals, and the motion that follows is compared with the measured one [rad]; its derivatives
by all parameters come from simulations side by side (`flexviz.model.servo`). What the joints do to each other
comes from their measured motion, and where that is fast from the model's own. The search, its criterion and
its results are those of every diagnosis.
"""

from flexviz.analysis.servo.diagnosing import diagnose_servos
from flexviz.analysis.servo.free_errors import free_errors, free_maps, free_over_time
from flexviz.analysis.servo.identifying import identify_servos
from flexviz.analysis.servo.judge import FreeRun, TrajectoryJudge

__all__ = [
    "FreeRun",
    "TrajectoryJudge",
    "diagnose_servos",
    "free_errors",
    "free_maps",
    "free_over_time",
    "identify_servos",
]
