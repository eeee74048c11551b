"""What may become of a recording before it is written, whatever simulator made it, and the truth of that."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.filtered_logs import butterworth, low_pass
from benchmarks.running import Json
from flexviz.data.measurements import GroupTable

Array = NDArray[np.float64]

SMOOTH_HERTZ = 40.0  # band of the motion along which an unmodelled torque acts
REVERSAL = 0.02  # [rad/s] width of the sign of its velocity
SPOT = 0.3  # width of a rough spot, in standard deviations of the angle
SHAKING = 2 * np.pi * 3.1  # [rad/s] of a vibration


@dataclass(frozen=True)
class Recording:
    """Groups with one time step as they are written, names of the joints, and what is hidden."""

    joints: tuple[str, ...]
    groups: tuple[GroupTable, ...]
    hidden: tuple[Json, ...]

    @property
    def rate(self) -> float:
        """[Hz]."""
        time = self.groups[0].time
        return float((len(time) - 1) / (time[-1] - time[0]))

    def all_of(self, values: Callable[[GroupTable], Array]) -> Array:
        """Of all groups, one after the other."""
        return np.concatenate([values(g) for g in self.groups])

    def each(self, change: Callable[[GroupTable], GroupTable], *hidden: Json) -> Recording:
        """The same change in every group, and what is hidden by that."""
        return Recording(self.joints, tuple(map(change, self.groups)), (*self.hidden, *hidden))

    def torque(self, joint: int, change: Callable[[GroupTable], Array], *hidden: Json) -> Recording:
        """With another torque (N,) of a joint in every group."""
        mine = np.arange(len(self.joints)) == joint
        return self.each(lambda g: replace(g, tau=np.where(mine, change(g)[:, None], g.tau)), *hidden)


def entry(effect: str, joint: str | None, kind: str = "", /, **parameters: float) -> Json:
    """A hidden effect as the truth has it."""
    place = {"effect": effect, "joint": joint, "group": None, "payload": None}
    return place | {"parameters": parameters, "kind": kind or effect}


def thinned(one: Recording, every: int) -> Recording:
    """Every so-many-th row."""
    return one.each(lambda g: replace(g, time=g.time[::every], theta=g.theta[::every], tau=g.tau[::every]))


def scaled(one: Recording, joint: int, gain: float) -> Recording:
    """The torque that acts is 1 + gain times the recorded one."""
    hidden = entry("torque_gain", one.joints[joint], gain_error=gain)
    return one.torque(joint, lambda g: g.tau[:, joint] / (1.0 + gain), hidden)


def late(one: Recording, joint: int, delay: float) -> Recording:
    """The torque of one joint is stamped that much later [s] than it acts."""
    hidden = entry("torque_delay", one.joints[joint], delay=-delay)
    return one.torque(joint, lambda g: np.interp(g.time - delay, g.time, g.tau[:, joint]), hidden)


def clipped(one: Recording, joint: int, share: float, noise: float) -> Recording:
    """The record of one joint saturates at that share of the smallest of its groups' peaks.

    `noise`: behind that limit [torque's standard deviations].
    """
    limit = share * min(float(np.abs(g.tau[:, joint]).max()) for g in one.groups)
    random = np.random.default_rng(round(1e6 * share)).standard_normal
    size = noise * float(one.all_of(lambda g: g.tau[:, joint]).std())
    hidden = entry("torque_limit", one.joints[joint], limit=limit)
    cut = lambda g: np.clip(g.tau[:, joint], -limit, limit) + size * random(len(g.time))  # noqa: E731
    return one.torque(joint, cut, hidden)


def low_passed(one: Recording, hertz: float, causal: bool, torque_only: bool) -> Recording:
    """Torque, or position too, through a low-pass of second order; a causal one makes slow motion late."""
    smooth, rate = (low_pass if causal else butterworth), one.rate
    lag = entry("torque_delay", None, delay=-float(np.sqrt(2.0)) / (2 * np.pi * hertz))
    slower = one.each(lambda g: replace(g, tau=smooth(g.tau, rate, hertz)), *[lag] * (causal and torque_only))
    return slower if torque_only else slower.each(lambda g: replace(g, theta=smooth(g.theta, rate, hertz)))


def rounded(one: Recording, bits: int) -> Recording:
    """Encoders with that many bits a turn of the joint."""
    step = 2 * np.pi / 2**bits
    return one.each(lambda g: replace(g, theta=np.round(g.theta / step) * step))


def unmodelled(one: Recording, joint: int, share: float, law: str) -> Recording:
    """A torque that no library has, that share (rms) of the standard deviation of the joint's torque.

    It is added to the record: along the same motion the motor has to give just that much more.
    """
    angles = one.all_of(lambda g: g.theta[:, joint])
    middle, width = float(np.median(angles)), SPOT * float(angles.std())
    laws: dict[str, Callable[[Array, Array, Array], Array]] = {
        "rough_spot": lambda t, x, sign: np.exp(-(((x - middle) / width) ** 2)) * sign,
        "one_way": lambda t, x, sign: np.where(x > middle, np.maximum(sign, 0.0), 0.0),
        "vibration": lambda t, x, sign: np.sin(SHAKING * t),
    }

    def shape(group: GroupTable) -> Array:
        angle = butterworth(group.theta[:, joint], one.rate, SMOOTH_HERTZ)
        return laws[law](group.time, angle, np.tanh(np.gradient(angle, group.time) / REVERSAL))

    torque = share * float(one.all_of(lambda g: g.tau[:, joint]).std())
    size = torque / float(np.sqrt(np.mean(one.all_of(shape) ** 2)))
    hidden = entry("unknown", one.joints[joint], law, size=size)
    return one.torque(joint, lambda g: g.tau[:, joint] + size * shape(g), hidden)
