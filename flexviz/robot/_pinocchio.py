"""Pinocchio as an untyped module: its names come from a compiled extension that type checkers cannot see."""

from typing import Any

import numpy as np
import pinocchio

pin: Any = pinocchio


def parent_joint(frame: Any) -> int:
    """Index of the joint that moves a frame, under its name before and since Pinocchio 3."""
    return frame.parentJoint if hasattr(frame, "parentJoint") else frame.parent


def effort_limit(model: Any) -> Any:
    """(n,) upper limits of the torques [Nm], under their name before and since Pinocchio 3."""
    return model.upperEffortLimit if hasattr(model, "upperEffortLimit") else model.effortLimit


def torques(model: Any, q: Any, v: Any, a: Any) -> Any:
    """Rigid inverse dynamics (n, N) of states (n, N), in one thread: other cores have other work."""
    if hasattr(pin, "ModelPool"):
        return pin.rneaInParallel(1, pin.ModelPool(model, 1), q, v, a)
    data = model.createData()  # builds of Pinocchio 2
    return np.array([pin.rnea(model, data, *state) for state in zip(q.T, v.T, a.T, strict=True)]).T
