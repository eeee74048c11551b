"""Data types shared by effects and the identification equation: motions, parameters, targets, terms."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, Protocol

import numpy as np

from flexviz.base.arrays import Array, Bools
from flexviz.base.units import joint_unit

Where = Literal["motor", "link", "joint", "sensing", "load"]
Entry = Literal["torque", "deflection", "residual", "gravity"]
Scope = Literal["joint", "set", "payload", "episode"]

SIGN_VELOCITY = 0.005  # [rad/s] sign(v) is smoothed to tanh(v / 0.005 rad/s)


def smooth_sign(velocity: Array) -> Array:
    """sign(v) as tanh(v / 0.005 rad/s)."""
    return np.tanh(velocity / SIGN_VELOCITY)


def neighbour(joint: int, joints: int) -> int:
    """The joint beside one of `joints`: the next one, or the one before the last."""
    return joint + 1 if joint + 1 < joints else max(joint - 1, 0)


@dataclass(frozen=True)
class ParameterSpec:
    """One parameter of an effect.

    Attributes:
        name: as in the JSON contract.
        unit: SI unit, on a joint that turns.
        lower, upper: physical bounds.
        explanation: a few words.
        symbol: as in the equation; defaults to the name.
        above_torque: a torque that may exceed the largest measured one: it balances another.
        lower_occurs: the lower bound is a valid result (one cycle per turn), not a diverged search.
        sliding_unit: on a joint that slides; by default `unit` with m and N for rad and Nm.
        given: a constant of the effect, set from the range of the data (`Effect.constants`), not estimated.
    """

    name: str
    unit: str
    lower: float = -np.inf
    upper: float = np.inf
    explanation: str = ""
    symbol: str = ""
    lower_occurs: bool = False
    above_torque: bool = False
    given: bool = False
    sliding_unit: str | None = None

    def unit_on(self, slides: bool) -> str:
        """Unit on a joint that slides or turns."""
        return self.sliding_unit if slides and self.sliding_unit else joint_unit(self.unit, slides)

    def __post_init__(self) -> None:
        if not self.symbol:
            object.__setattr__(self, "symbol", self.name)


# shared by the friction effects
ARMSTRONG = (
    "Armstrong-Hélouvry, Dupont, Canudas de Wit: A survey of models, analysis tools and compensation methods "
    "for the control of machines with friction, Automatica 30(7), 1994"
)
SLIDING = ParameterSpec("coulomb", "Nm", 0.0, explanation="friction torque while moving", symbol="f_c")


@dataclass(frozen=True)
class JointMotion:
    """Full-bandwidth motion of one joint during one stretch; arrays have shape (N,).

    Attributes:
        time: the group's own time [s].
        position, velocity: motor side θ, θ̇ [rad], [rad/s].
        torque: transmission torque s at the current parameters [Nm].
        link_position, link_velocity: link side q, q̇ at the current parameters [rad], [rad/s].
        stiffness: current K [Nm/rad].
        motor_viscous: current f_mv [Nm s/rad].
        torque_scale: rms of s over all stretches [Nm].
        present: the joint's effects → current parameters.
        temperature: that the group states for the joint [°C]; NaN if it states none.
        notes: cache of a law for further calls with the same motion.
    """

    time: Array
    position: Array
    velocity: Array
    torque: Array
    link_position: Array
    link_velocity: Array
    stiffness: float
    motor_viscous: float
    torque_scale: float
    present: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    temperature: float = np.nan
    notes: dict[str, Array] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def step(self) -> float:
        """Sampling interval [s]."""
        return float(self.time[1] - self.time[0])


@dataclass(frozen=True)
class EffectTarget:
    """The place of an effect.

    Attributes:
        joint: index in the set's joint order; None for effects of a payload or the whole set.
        group: the only group in which it acts (episodes).
        payload: the payload that it changes.
    """

    joint: int | None = None
    group: str | None = None
    payload: str | None = None

    @property
    def own_joint(self) -> int:
        """The joint of an effect that has one."""
        assert self.joint is not None, "this effect belongs to a joint"
        return self.joint


@dataclass(frozen=True)
class Terms:
    """An effect at given parameters, filtered like all signals, at the equation's samples.

    Attributes:
        entry: "torque": u is subtracted from s; "deflection": added to q; "residual": subtracted from r;
            "gravity": subtracted from r within Y Γ (`Effect.gravity`).
        joints: the m joints it acts on.
        value: shape (D, N, m), u and its derivatives; D = 3, or 1 for the last two.
        slopes: shape (P, D, N, m), ∂u/∂p.
    """

    entry: Entry
    joints: tuple[int, ...]
    value: Array
    slopes: Array


@dataclass(frozen=True)
class Guess:
    """A linearised effect: a starting point for the search.

    Attributes:
        entry, joints: as in `Terms`.
        columns: shape (C, D, N, m).
        to_values: coefficients (C,) → the effect's parameters (P,).
    """

    entry: Entry
    joints: tuple[int, ...]
    columns: Array
    to_values: Callable[[Array], Array]


class JointState(NamedTuple):
    """One joint at one instant, in the simulator.

    Attributes:
        time: the group's own time [s].
        theta, theta_velocity: motor side [rad], [rad/s].
        q, q_velocity: link side [rad], [rad/s].
        load: joint torque by the library's laws [Nm].
        z: states of the law, if it has any.
    """

    time: float
    theta: float
    theta_velocity: float
    q: float
    q_velocity: float
    load: float
    z: Sequence[float] = ()


class Context(Protocol):
    """The equation's interface for effects: motions, filters and observer outputs."""

    def motions(self, joint: int) -> Sequence[JointMotion]:
        """Wide-band motion of a joint, one per stretch."""
        ...

    def once(self, key: tuple[object, ...], make: Callable[[], Array]) -> Array:
        """The result of `make`, for columns independent of parameters: cached if not too large."""
        ...

    def filtered(
        self, parts: Sequence[Array], joint: int, depth: int, every: Sequence[int] | None = None
    ) -> Array:
        """Columns (C, N_fine) of each stretch through the joint's observer: shape (C, depth, N).

        `every`: per stretch, which samples the columns have: every so many of the fine ones; default: all.
        """
        ...

    def decimation(self, joint: int, depth: int, highest: float) -> list[int]:
        """Per stretch, every how many fine samples suffice without content above `highest` [rad/s]."""
        ...

    def theta(self, joint: int) -> Array:
        """Observer's θ and derivatives, shape (5, N)."""
        ...

    def tau(self, joint: int) -> Array:
        """Observer's τ and derivatives, shape (4, N)."""
        ...

    def delayed_tau(self, joint: int, delay: float) -> Array:
        """The same for the torque applied `delay` [s] later, shape (4, N)."""
        ...

    def of_torque(self, joint: int, law: Callable[[Array], Array]) -> Array:
        """Columns (C, M) that `law` makes of each stretch of raw torque (M,), filtered: shape (C, 3, N)."""
        ...

    def link_state(self, joint: int) -> Array:
        """Link side q, q̇, q̈ at the current parameters, shape (3, N)."""
        ...

    def in_group(self, group: str) -> Bools:
        """Samples of that group, shape (N,)."""
        ...

    def payload_torque(self, payload: str) -> Array:
        """Y Γ_payload in the groups that carry it, zero elsewhere, shape (N, n) [Nm]."""
        ...

    def gravity_torque(self, axis: int) -> Array:
        """Joint torque of unit gravity acceleration along a base axis, shape (N, n) [Nm s²/m]."""
        ...

    def gravity(self) -> Array:
        """Acceleration of gravity (3,) [m/s²] that the set states, in the base's frame."""
        ...

    def count(self) -> int:
        """Number of samples N."""
        ...

    def joints(self) -> int:
        """Number of joints n."""
        ...
