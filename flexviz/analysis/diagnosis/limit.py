"""Down to which size nothing is missing, and what hides smaller effects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.motion import MOTION, MotionContext
from flexviz.checks import filtered_before_writing
from flexviz.content.records import DetectionLimit, LimitReason
from flexviz.data.measurements import Segment
from flexviz.data.noise import segments_noise

Array = NDArray[np.float64]


def detection_limit(context: MotionContext, left: Sequence[float]) -> DetectionLimit | None:
    """The limit of the joint where it is largest; None where no joint has a torque.

    Args:
        context: the set in the band of the motion.
        left: rms error of each joint [Nm].
    """
    spread, least = context.spread, context.least
    moved = spread > 0
    if not moved.any():
        return None
    shares = np.where(moved, np.maximum(least, left) / np.where(moved, spread, 1.0), 0.0)
    j = int(np.argmax(shares))
    return DetectionLimit(float(shares[j]), _reason(context, j))


def _reason(context: MotionContext, joint: int) -> LimitReason:
    segments = [s for g in context.measurements.fit_groups for s in g.segments]
    if context.least[joint] <= MOTION.tolerance * context.spread[joint]:
        return "tolerance" if filtered_before_writing(segments).hertz is None else "filter"
    return "resolution" if _stepped(segments, joint) else "noise"


def _stepped(segments: Sequence[Segment], joint: int) -> bool:
    """Whether the noise of a joint's position is that of its encoder's steps."""
    steps = np.abs(np.concatenate([np.diff(s.theta[:, joint]) for s in segments]))
    steps = steps[steps > 0]
    noise = float(segments_noise(segments)[0][joint])
    return bool(len(steps)) and float(steps.min()) / np.sqrt(12) > 0.5 * noise
