"""Laws of one's own on a joint, beside the library's: for studies of what a library does not have."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar, NamedTuple


class JointState(NamedTuple):
    """One joint at one instant.

    Attributes
    ----------
    time: the group's own time [s].
    theta, theta_velocity: motor side [rad], [rad/s].
    q, q_velocity: link side [rad], [rad/s].
    load: torque that the joint carries by the library's laws [Nm].
    z: the law's own states.
    """

    time: float
    theta: float
    theta_velocity: float
    q: float
    q_velocity: float
    load: float
    z: Sequence[float] = ()


class Pull(NamedTuple):
    """What a law does to its joint.

    Attributes
    ----------
    motor, link: torques that oppose the motor and the link [Nm].
    joint: torque that the joint carries beside the library's [Nm].
    rates: time derivatives of the law's own states.
    """

    motor: float = 0.0
    link: float = 0.0
    joint: float = 0.0
    rates: Sequence[float] = ()


class OwnLaw(ABC):
    """A law on one joint. It has to be smooth over an integration step; its own states start at zero.

    Attributes
    ----------
    states: number of its own states.
    """

    states: ClassVar[int] = 0

    @abstractmethod
    def pull(self, at: JointState) -> Pull:
        """Its torques at one instant, and the rates of its states."""
