"""Laws beyond the library's: user-defined effects, and laws for studies of unknown effects."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar, NamedTuple

import numpy as np

from flexviz.effects import Effect, JointState


class Pull(NamedTuple):
    """Torques of a law on its joint.

    Attributes:
        motor, link: torques opposing the motor and the link [Nm].
        joint: additional joint torque [Nm].
        rates: time derivatives of the law's states.
    """

    motor: float = 0.0
    link: float = 0.0
    joint: float = 0.0
    rates: Sequence[float] = ()


class ExtraLaw(ABC):
    """A law on one joint, smooth over an integration step.

    Attributes:
        states: number of its states, which start at zero.
    """

    states: ClassVar[int] = 0

    @abstractmethod
    def pull(self, at: JointState) -> Pull:
        """Its torques at one instant, and the rates of its states."""


class UserEffectLaw(ExtraLaw):
    """The torque of a user-defined effect, on the side where the effect acts."""

    def __init__(self, where: str, torque: Callable[[JointState], float]) -> None:
        self._where, self._torque = where, torque

    @staticmethod
    def of(effect: Effect, parameters: Mapping[str, float]) -> UserEffectLaw:
        """The law of an effect that can be simulated, with these parameters."""
        torque = effect.simulation(np.array([parameters[p.name] for p in effect.parameters]))
        assert torque is not None
        return UserEffectLaw(effect.where, torque)

    def pull(self, at: JointState) -> Pull:
        torque = float(self._torque(at))
        if self._where == "motor":
            return Pull(motor=torque)
        return Pull(link=torque) if self._where == "link" else Pull(joint=torque)
