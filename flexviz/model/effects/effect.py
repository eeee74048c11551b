"""Base class of the physical effects: law, texts and properties for estimation and simulation."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

import numpy as np

from flexviz.model.effects.targets import ServoTargets
from flexviz.model.effects.terms import (
    Array,
    Context,
    EffectTarget,
    Entry,
    Guess,
    JointState,
    ParameterSpec,
    Scope,
    Terms,
    Where,
)


@dataclass(frozen=True)
class EffectEvidence:
    """Data of a fit by which an effect is judged, besides its parameters.

    Attributes:
        torque: shape (N,), transmission torque of the effect's joint [Nm].
        record_step: sampling interval of the recordings [s].
        viscous: viscous friction of the effect's joint, motor and link side together [Nm s/rad].
        top_speed: largest velocity of the effect's joint in either direction [rad/s].
        travel: range of the effect's joint [rad].
        explained: whether the model leaves nothing that counts on the effect's joint.
    """

    torque: Array
    record_step: float
    viscous: float = np.inf
    top_speed: float = np.inf
    travel: float = np.inf
    explained: bool = False


@dataclass(frozen=True)
class JointScale:
    """Magnitudes of a joint's motion, to which the size of an effect is compared.

    Attributes:
        torque, speed, deflection: rms [Nm], [rad/s], [rad].
        stiffness: K [Nm/rad].
        motor_inertia, neighbour_inertia: B of this and of the neighbouring joint [kg m²].
        position: at the start [rad].
        duration: of a group [s].
        viscous: viscous friction, motor and link side together [Nm s/rad].
    """

    torque: float
    speed: float
    deflection: float
    stiffness: float
    motor_inertia: float
    neighbour_inertia: float
    position: float
    duration: float
    viscous: float


@dataclass(frozen=True)
class HiddenStart:
    """Initial parameters of an effect, and the matching compliance of the joint [rad/Nm]."""

    values: tuple[float, ...]
    compliance: float


class Effect(ABC):
    """A physical effect in addition to the base model.

    Motor effects add their torque to the motor's friction, s = τ − Bθ̈ − f_mv θ̇ − u, and so shift q and its
    derivatives by those of u/K; joint effects change the deflection, q = θ − s/K + u; link and load effects
    add theirs to the link side, r = s − Y Γ − f_lv q̇ − u.

    Attributes:
        name: snake_case, for commands and files.
        title: for display.
        where: "motor", "link", "joint", "sensing" or "load".
        explanation: one sentence that a technician understands.
        equation: u, or the changed quantity, in the symbols of `parameters`.
        signature: its shape in a residual.
        plot_against: the variable against which its law is drawn through the data, a key of
            `flexviz.analysis.laws.VARIABLES`; the usual one of its side where empty.
        confirm: data that confirm it.
        simulated: its simulation, if that is not u on its side.
        reference: literature.
        parameters: in the order of `values` everywhere.
        linear: u is linear in the parameters.
        state: u depends on identified quantities (torque, link side, stiffness, f_mv).
        scope: what it belongs to. The parameters of an episode are its size, start and end.
        fewest_joints: number of joints that a robot needs to have it.
        joint_optional: it belongs to the set, or to one joint; on all joints it replaces that on single ones.
        beside: another effect that it requires on its joint.
        replaces: an effect that it refines and therefore replaces on its joint.
        twins: effects that the same data usually cannot distinguish from it.
        hidden_state: no encoder measures its state, so that even a good fit leaves a larger residual.
        abrupt: u jumps in position, of which a narrow filter leaves too little to tell it from compliance.
        damps_deflection: it low-passes the path from joint torque to deflection, including sensor noise.
        relative: u is proportional to `motion.motor_viscous`, so that it changes with f_mv.
        memory: u depends on the time before the record.
        by_temperature: u depends on the temperature of the runs, which their groups have to state.
        common: always listed, not in a folded section.
        instead_of: an effect of the same joint for which it may be mistaken; the better one is kept.
        merges: effects of the same joint for which, found together, it stands alone where they are no better.
        only_among_many: a search for single effects leaves it out.
        after_rest: it acts on what follows a standstill only.
        scales_torque: its first parameter g scales the recorded torque by 1 + g.
        limits_torque: its first parameter is a limit at which the recorded torque may be seen to stand.
        size_at: positions of the parameters that are zero when the effect is absent.
        stopgap: not physics: never a candidate, added only on request.
        sensed: an error of a torque sensor may be of the same form.
        usual: most robots have it, on any joint: the search backwards starts with it everywhere.
        constant: u is a constant torque.
        offset_parameter: parameter that amounts to a constant torque of the joint.
        expected: parameter → standard deviation around zero that a real robot may show.
        example: clearly visible parameters, for checks and for simulated sets that give none.
        servo_targets: what the formats of servos make of it, on joints that follow goals.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    where: ClassVar[Where]
    explanation: ClassVar[str]
    equation: ClassVar[str]
    signature: ClassVar[str]
    plot_against: ClassVar[str] = ""
    confirm: ClassVar[str]
    simulated: ClassVar[str] = ""
    reference: ClassVar[str]
    parameters: ClassVar[tuple[ParameterSpec, ...]]
    linear: ClassVar[bool] = False
    state: ClassVar[bool] = False
    scope: ClassVar[Scope] = "joint"
    fewest_joints: ClassVar[int] = 1
    joint_optional: ClassVar[bool] = False
    beside: ClassVar[str | None] = None
    replaces: ClassVar[str | None] = None
    twins: ClassVar[tuple[str, ...]] = ()
    hidden_state: ClassVar[bool] = False
    abrupt: ClassVar[bool] = False
    damps_deflection: ClassVar[bool] = False
    relative: ClassVar[bool] = False
    memory: ClassVar[bool] = False
    by_temperature: ClassVar[bool] = False
    common: ClassVar[bool] = False
    instead_of: ClassVar[str | None] = None
    merges: ClassVar[tuple[str, ...]] = ()
    only_among_many: ClassVar[bool] = False
    after_rest: ClassVar[bool] = False
    scales_torque: ClassVar[bool] = False
    limits_torque: ClassVar[bool] = False
    size_at: ClassVar[tuple[int, ...]] = (0,)
    stopgap: ClassVar[bool] = False
    sensed: ClassVar[bool] = False
    usual: ClassVar[bool] = False
    constant: ClassVar[bool] = False
    offset_parameter: ClassVar[str | None] = None
    expected: ClassVar[Mapping[str, float]] = {}
    example: ClassVar[tuple[float, ...]] = ()
    servo_targets: ClassVar[ServoTargets] = MappingProxyType({})

    def __init_subclass__(cls) -> None:
        cls.__doc__ = cls.__doc__ or getattr(cls, "explanation", None)

    @property
    def units(self) -> dict[str, str]:
        """Parameter → its unit on a joint that turns."""
        return self.units_on(False)

    def units_on(self, slides: bool) -> dict[str, str]:
        """Parameter → its unit on a joint that slides or turns."""
        return {p.name: p.unit_on(slides) for p in self.parameters}

    @property
    def entry(self) -> Entry:
        """How u enters the equation."""
        entries: dict[Where, Entry] = {"motor": "torque", "sensing": "torque", "joint": "deflection"}
        return entries.get(self.where, "residual")

    @property
    def behind_gear(self) -> bool:
        """Whether a torque sensor behind the gear can show it: it is none of motor and gear."""
        return self.where != "motor" or self.sensed

    @property
    def behind_spring(self) -> bool:
        """Whether it is none, or the same as another effect, on a joint without elasticity."""
        return self.where == "joint"

    @abstractmethod
    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        """u and ∂u/∂p at the parameters `values`, shape (P,)."""

    def guesses(self, context: Context, place: EffectTarget) -> list[Guess]:
        """Linearised versions to score, over a grid of the nonlinear parameters; here the slopes at zero."""
        terms = self.terms(context, place, np.zeros(len(self.parameters)))
        return [Guess(terms.entry, terms.joints, terms.slopes, np.array)]

    def targets(self, joints: int, payloads: Iterable[str]) -> list[EffectTarget]:
        """All its possible targets in a robot; none for episodes, which are searched for instead."""
        if joints < self.fewest_joints or self.scope == "episode":
            return []
        if self.scope == "payload":
            return [EffectTarget(payload=payload) for payload in payloads]
        each = [EffectTarget(j) for j in range(joints)]
        if self.scope == "set":
            return [EffectTarget(), *(each if self.joint_optional and joints > 1 else [])]
        return each

    def replaced_by(self, own: EffectTarget, other: EffectTarget) -> bool:
        """Whether a model that has it at the other place, on all joints, has no use for its `own` one."""
        return self.joint_optional and own.joint is not None and other.joint is None

    def constants(self, reach: Mapping[str, tuple[float, float]]) -> Array:
        """Its leading parameters, those that are `given`.

        Args:
            reach: range of "position" [rad], "velocity" [rad/s], "load" [Nm] and "time" [s] on its joint.
        """
        return np.zeros(0)

    def precision(self, torque: float) -> Array | None:
        """Inverse covariance (P, P) of a prior on top of the parameters' own; `torque`: the joint's rms."""
        return None

    def gravity(self, values: Array, stated: Array) -> Array | None:
        """Acceleration of gravity (3,) [m/s²] instead of the `stated` one, in the base's frame.

        It enters Y. None unless the terms' entry is "gravity".
        """
        return None

    # -- judging a fit

    def possible(self, values: Array) -> bool:
        """Whether the parameters, shape (P,), are consistent; their bounds are in `parameters`."""
        return True

    def at_bound(self, values: Array) -> bool:
        """Whether a parameter ended at a bound: a gain of −80 % is a diverged search, not a finding."""
        return any(
            edge and np.isfinite(edge) and abs(value - edge) <= 1e-6 * abs(edge)
            for value, p in zip(values, self.parameters, strict=True)
            for edge in (0.0 if p.lower_occurs else p.lower, p.upper)
        )

    def credible(self, values: Array, evidence: EffectEvidence) -> bool:
        """Whether fitted parameters, shape (P,), are possible, and their form is visible in the motion."""
        return not self.at_bound(values)

    def with_constant(self, values: Array, torque: float) -> Array:
        """Parameters that add a constant torque [Nm] to u, by `offset_parameter`; shape (P,)."""
        return values

    # -- search and noise model

    @property
    def absorbed_by_stiffness(self) -> bool:
        """Whether a fitted stiffness can absorb part of it, so that its score is too low."""
        return self.where == "joint"

    @property
    def underrated(self) -> bool:
        """Whether parameters that are biased without the effect may hide it from its score."""
        return self.absorbed_by_stiffness

    def hidden_starts(self, torque: Array, compliance: float, rough: float) -> list[HiddenStart]:
        """Starts that undo the absorption of an underrated effect by the fitted compliance and friction.

        `torque`: (N,), transmission torque [Nm]; `compliance`, `rough`: fitted, and the set's [rad/Nm].
        """
        return []

    def time_constant(self, values: Array, compliance: float) -> float:
        """Time constant of the low-pass from joint torque to deflection [s]; 0 without damping."""
        return 0.0

    def softness(self, values: Array, torque: Array, compliance: float) -> Array | float:
        """Local compliance of the joint relative to its own one, under a torque (N,) [Nm]: shape (N,)."""
        return 1.0

    def refining(self, simpler: Array) -> Array:
        """Start values from those of the effect that it replaces."""
        return self.sizes()

    def surprise(self, values: Array) -> float:
        """How far parameters are from what a real robot may show [nats], by `expected`."""
        pairs = zip(values, self.parameters, strict=True)
        return sum(0.5 * (v / self.expected[p.name]) ** 2 for v, p in pairs if p.name in self.expected)

    def merged(self, values: Mapping[str, Array]) -> Array:
        """Start values from those of the effects that it merges, by their names."""
        return self.sizes()

    # -- simulation

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        """Parameters that make it clearly visible on a joint without dominating it."""
        return tuple(float(value) for value in self.sizes())

    def simulation(self, values: Array) -> Callable[[JointState], float] | None:
        """Its torque at one instant, for the simulator; None if it cannot be simulated.

        Used for user-defined effects only; the simulator has independent implementations of the library's.
        Motor and link effects: the opposing torque u; joint effects: the joint torque beyond K (θ − q), [Nm]
        each. It has to be smooth over a millisecond.
        """
        return None

    def sizes(self) -> Array:
        """The example, or else values within the bounds, shape (P,)."""
        if self.example:
            return np.array(self.example, dtype=float)
        middle = []
        for p in self.parameters:
            low, high = np.isfinite(p.lower), np.isfinite(p.upper)
            between = p.lower + 0.3 * (p.upper - p.lower) if low and high else 0.8
            middle.append(between if low == high else p.lower + 0.8 if low else p.upper - 0.8)
        return np.array(middle)
