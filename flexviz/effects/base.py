"""What a physical effect is: one class with its law and how it enters the identification equation."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import ClassVar, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Where = Literal["motor", "link", "joint", "sensing", "load"]
Entry = Literal["torque", "deflection", "residual"]
Scope = Literal["joint", "set", "payload", "episode"]

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
        symbol: as in the equation; its name where there is none.
        lower_occurs: the lower bound is a value that occurs, as one cycle a turn: not where a search ran to.
    """

    name: str
    unit: str
    lower: float = -np.inf
    upper: float = np.inf
    explanation: str = ""
    symbol: str = ""
    lower_occurs: bool = False

    def __post_init__(self) -> None:
        if not self.symbol:
            object.__setattr__(self, "symbol", self.name)


@dataclass(frozen=True)
class JointMotion:
    """What an effect sees of its joint during one stretch, wide-band; every array has shape (N,).

    Attributes:
        time: the group's own time [s].
        position, velocity: motor side θ, θ̇ [rad], [rad/s].
        torque: transmission torque s at the present parameters [Nm].
        link_position, link_velocity: link side q, q̇ at the present parameters [rad], [rad/s].
        stiffness: present K [Nm/rad].
        motor_viscous: present f_mv [Nm s/rad].
        torque_scale: rms of s over all stretches [Nm].
        present: effect → its present parameters, of the joint's effects.
        notes: what a law keeps for its next call with this very motion.
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
    notes: dict[str, Array] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def step(self) -> float:
        """Between samples [s]."""
        return float(self.time[1] - self.time[0])


@dataclass(frozen=True)
class EffectTarget:
    """Where an effect sits.

    Attributes:
        joint: index in the set's joint order; None where it belongs to no joint.
        group: name of the only group it acts in (episodes).
        payload: name of the payload it concerns.
    """

    joint: int | None = None
    group: str | None = None
    payload: str | None = None


@dataclass(frozen=True)
class Terms:
    """An effect at given parameters, filtered like everything else, at the equation's samples.

    Attributes:
        entry: "torque": u is subtracted from s; "deflection": added to q; "residual": subtracted from r.
        joints: the m joints it acts on.
        value: shape (D, N, m), u and its derivatives; D = 3, or 1 for "residual".
        slopes: shape (P, D, N, m), ∂u/∂p.
    """

    entry: Entry
    joints: tuple[int, ...]
    value: Array
    slopes: Array


@dataclass(frozen=True)
class Guess:
    """A small version of an effect, linear in its coefficients: where a search starts.

    Attributes:
        entry, joints: as in `Terms`.
        columns: shape (C, D, N, m).
        to_values: coefficients (C,) → the effect's parameters (P,).
        label: what is fixed in it, for the log ("order 7").
    """

    entry: Entry
    joints: tuple[int, ...]
    columns: Array
    to_values: object
    label: str = ""


class Instant(Protocol):
    """What the simulator shows of one joint at one instant.

    Attributes:
        time: the group's own time [s].
        theta, theta_velocity: motor side [rad], [rad/s].
        q, q_velocity: link side [rad], [rad/s].
        load: torque that the joint carries [Nm].
    """

    @property
    def time(self) -> float: ...
    @property
    def theta(self) -> float: ...
    @property
    def theta_velocity(self) -> float: ...
    @property
    def q(self) -> float: ...
    @property
    def q_velocity(self) -> float: ...
    @property
    def load(self) -> float: ...


class Context(Protocol):
    """What the equation offers to an effect: motions, filters, and the observer's own outputs."""

    def motions(self, joint: int) -> Sequence[JointMotion]:
        """Wide-band motion of a joint, one a stretch."""
        ...

    def once(self, key: tuple[object, ...], make: Callable[[], Array]) -> Array:
        """What `make` gives, made once for all models: for columns that no parameter changes."""
        ...

    def filtered(self, parts: Sequence[Array], joint: int, depth: int) -> Array:
        """Columns (C, N_fine) of each stretch through the joint's observer: shape (C, depth, N)."""
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

    def link_state(self, joint: int) -> Array:
        """Link side q, q̇, q̈ at the present parameters, shape (3, N)."""
        ...

    def in_group(self, group: str) -> NDArray[np.bool_]:
        """Samples of that group, shape (N,)."""
        ...

    def payload_torque(self, payload: str) -> Array:
        """Y Γ_payload in the groups that carry it, zero elsewhere, shape (N, n) [Nm]."""
        ...

    def gravity_torque(self, axis: int) -> Array:
        """Joint torque of unit gravity acceleration along a base axis, shape (N, n) [Nm s²/m]."""
        ...

    def count(self) -> int:
        """Number of samples N."""
        ...

    def joints(self) -> int:
        """Number of joints n."""
        ...


class Effect(ABC):
    """A physical effect beside the base model.

    Motor effects add their torque to the motor's friction, s = τ − Bθ̈ − f_mv θ̇ − u, and so shift q and its
    derivatives by those of u/K; joint effects change the deflection, q = θ − s/K + u; link and load effects
    add theirs to the link side, r = s − Y Γ − f_lv q̇ − u.

    Attributes:
        name: as commands and files call it, snake_case.
        title: as people call it.
        where: "motor", "link", "joint", "sensing" or "load".
        explanation: one sentence that a technician understands.
        equation: u, or what is changed, in the symbols of `parameters`.
        signature: how it shows in a residual.
        confirm: which data confirm it.
        simulated: what the simulator does with it, where that is not u on its side.
        reference: where it is described.
        parameters: its parameters, in the order of `values` everywhere.
        linear: u is linear in the parameters.
        state: u depends on identified quantities (torque, link side, stiffness, f_mv) and is renewed as these
            change.
        scope: what it belongs to.
        beside: an effect without which this one makes no sense on a joint.
        replaces: an effect that it replaces on its joint.
        example: parameters at which it is clearly there: for checks, and for simulated sets that name none.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    where: ClassVar[Where]
    explanation: ClassVar[str]
    equation: ClassVar[str]
    signature: ClassVar[str]
    confirm: ClassVar[str]
    simulated: ClassVar[str] = ""
    reference: ClassVar[str]
    parameters: ClassVar[tuple[ParameterSpec, ...]]
    linear: ClassVar[bool] = False
    state: ClassVar[bool] = False
    scope: ClassVar[Scope] = "joint"
    beside: ClassVar[str | None] = None
    replaces: ClassVar[str | None] = None
    example: ClassVar[tuple[float, ...]] = ()
    flexible: ClassVar[bool] = False
    """Whether it can imitate unknown position effects (ripples of free order)."""
    relative: ClassVar[bool] = False
    """Whether u is proportional to `motion.motor_viscous`, so that it moves with f_mv, too."""

    @property
    def entry(self) -> Entry:
        """How it enters the equation."""
        return {"motor": "torque", "joint": "deflection"}.get(self.where, "residual")  # type: ignore[return-value]

    def possible(self, values: Array) -> bool:
        """Whether the parameters, shape (P,), go together; each one's own bounds are in `parameters`."""
        return True

    @abstractmethod
    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        """u and ∂u/∂p at the parameters `values`, shape (P,)."""

    @abstractmethod
    def guesses(self, context: Context, place: EffectTarget) -> list[Guess]:
        """Small versions of it to score, over a grid of whatever is nonlinear."""

    def simulation(self, values: Array) -> Callable[[Instant], float] | None:
        """Its torque at one instant, for the simulator; None where there is none.

        Only effects of one's own are asked: the library's are written down once more in the simulator. Motor
        and link effects: the torque against the motion, u itself; joint effects: what the joint carries
        beside K (θ − q), [Nm] each. It has to be smooth over a millisecond.
        """
        return None

    def sizes(self) -> Array:
        """The example, or else something between the bounds, shape (P,)."""
        if self.example:
            return np.array(self.example, dtype=float)
        middle = []
        for p in self.parameters:
            low, high = np.isfinite(p.lower), np.isfinite(p.upper)
            between = p.lower + 0.3 * (p.upper - p.lower) if low and high else 0.8
            middle.append(between if low == high else p.lower + 0.8 if low else p.upper - 0.8)
        return np.array(middle)


class LawEffect(Effect):
    """An effect whose u is a law of its joint's own motion, evaluated wide-band and then filtered.

    Attributes:
        memory: u depends on what was before the record (`unknown` says how).
        smooth: u never jumps where a velocity or torque passes zero, so that nothing is undecided there.
        grid: parameter → values at which a search tries it; in the other ones u is linear from zero on.
    """

    grid: ClassVar[Mapping[str, Sequence[float]]] = {}
    memory: ClassVar[bool] = False
    smooth: ClassVar[bool] = False

    @abstractmethod
    def law(self, motion: JointMotion, values: Array) -> tuple[Array, Array]:
        """u, shape (N,), and ∂u/∂p, shape (P, N)."""

    def unknown(self, motion: JointMotion, values: Array) -> Array:
        """What the time before the record may add to u, one standard deviation each, shape (M, N)."""
        return np.zeros((0, len(motion.time)))

    def undecided(self, motion: JointMotion, values: Array) -> tuple[NDArray[np.bool_], Array] | None:
        """Where the motion does not tell u and by how much u may swing there, shape (N,) each.

        None: wherever the law jumps within what noise does to its signals.
        """
        return None

    @property
    def depth(self) -> int:
        return 1 if self.entry == "residual" else 3

    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        joint = _joint(place)
        parts = []
        for motion in context.motions(joint):
            u, slopes = self.law(motion, values)
            parts.append(np.concatenate((u[None], slopes)))
        out = context.filtered(parts, joint, self.depth)[..., None]
        return Terms(self.entry, (joint,), out[0], out[1:])

    def guess(self, context: Context, place: EffectTarget, values: Array, label: str = "") -> Guess:
        """The slopes at `values` as columns; their coefficients are added to `values`."""
        terms = self.terms(context, place, values)
        return Guess(terms.entry, terms.joints, terms.slopes, lambda c: values + c, label)

    def guesses(self, context: Context, place: EffectTarget) -> list[Guess]:
        names = [p.name for p in self.parameters]
        free = [k for k, name in enumerate(names) if name not in self.grid]
        out = []
        for tried in product(*self.grid.values()):
            start = np.zeros(len(names))
            start[[names.index(name) for name in self.grid]] = tried
            whole = self.guess(context, place, start)

            def to_values(c: Array, start: Array = start) -> Array:
                values = start.copy()
                values[free] = c
                return values

            label = ", ".join(f"{name} {value:g}" for name, value in zip(self.grid, tried, strict=True))
            out.append(Guess(whole.entry, whole.joints, whole.columns[free], to_values, label))
        return out


class LinearEffect(LawEffect):
    """u = Σ p · column(t)."""

    linear = True

    @abstractmethod
    def columns(self, motion: JointMotion) -> Array:
        """∂u/∂p for each parameter, shape (P, N) [Nm per unit of p]."""

    def law(self, motion: JointMotion, values: Array) -> tuple[Array, Array]:
        columns = self.columns(motion)
        return values @ columns, columns


def _joint(place: EffectTarget) -> int:
    assert place.joint is not None, "this effect belongs to a joint"
    return place.joint
