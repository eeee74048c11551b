"""What a physical effect is: one class with its law and how it enters the identification equation."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Where = Literal["motor", "link", "joint", "sensing", "load"]

SIGN_VELOCITY = 0.005  # [rad/s] sign(v) is taken as tanh(v / 0.005 rad/s)


def smooth_sign(velocity: Array) -> Array:
    """sign(v) as tanh(v / 0.005 rad/s)."""
    return np.tanh(velocity / SIGN_VELOCITY)


@dataclass(frozen=True)
class ParameterSpec:
    """One parameter of an effect.

    Attributes:
        name: as in the JSON contract.
        unit: SI unit.
        lower, upper: physical bounds.
        explanation: what it is, in a few words.
    """

    name: str
    unit: str
    lower: float = -np.inf
    upper: float = np.inf
    explanation: str = ""


@dataclass(frozen=True)
class JointMotion:
    """What an effect sees of its joint, at the measurement's own rate; every array has shape (N,).

    Attributes:
        time: [s].
        velocity: motor side θ̇ from a wide zero-phase filter [rad/s].
        link_velocity: link side q̇ at the present stiffness, from a wide zero-phase filter [rad/s].
    """

    time: Array
    velocity: Array
    link_velocity: Array


class Effect(ABC):
    """A torque that a joint has beside the base model.

    Effects of `where` "motor" add their torque to the motor's friction, s = τ − Bθ̈ − f_mv θ̇ − u; effects of
    `where` "link" add theirs to the link's, r = s − Y Γ − f_lv q̇ − u. Both must be linear in their
    parameters: u = Σ_p p · column_p(t).
    """

    name: ClassVar[str]
    title: ClassVar[str]
    where: ClassVar[Where]
    explanation: ClassVar[str]
    equation: ClassVar[str]
    reference: ClassVar[str]
    parameters: ClassVar[tuple[ParameterSpec, ...]]

    @abstractmethod
    def columns(self, motion: JointMotion) -> Array:
        """∂u/∂p for each parameter, shape (P, N) [Nm per unit of p]."""
