"""What drives the joints of a set, in the titles of charts: a recorded torque, or goals."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class DrivingSignal:
    """The signal that a model explains, of joints that turn.

    Attributes:
        title: of a chart of it, and `within` a sentence.
        residual: title of a chart of what a model leaves of it.
        waiting: what is not there before a fit.
        explanation: of the symbol; empty where the glossary has it.
    """

    title: str
    within: str
    symbol: str
    unit: str
    residual: str
    waiting: str
    explanation: str = ""


TORQUE_SIGNAL = DrivingSignal(
    "Torque", "the torque", "τ", "Nm", "Residual", "Model torque and residual appear"
)
GOAL_SIGNAL = DrivingSignal(
    "Goal − position",
    "goal − position",
    "goal − θ",
    "rad",
    "Simulated − measured θ",
    "The simulated motion appears",
    "how far the servo's goal is ahead of its position",
)


def driving_signal(goals: bool) -> DrivingSignal:
    """That of joints which follow `goals`, or whose torque was recorded."""
    return GOAL_SIGNAL if goals else TORQUE_SIGNAL
