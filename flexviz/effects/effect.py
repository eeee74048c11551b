"""A physical effect: its law, its texts, and everything other packages need to know about it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from flexviz.effects.terms import (
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
    """What a fit shows about an effect besides its parameters.

    Attributes:
        torque: shape (N,), transmission torque of the effect's joint [Nm].
        record_step: sampling interval of the recordings [s].
        effects: names of all effects in the model.
    """

    torque: Array
    record_step: float
    effects: frozenset[str] = frozenset()


@dataclass(frozen=True)
class JointScale:
    """How hard a joint works in a motion: the yardstick of an effect's size.

    Attributes:
        torque, speed, deflection: rms [Nm], [rad/s], [rad].
        stiffness: K [Nm/rad].
        motor_inertia, neighbour_inertia: B of this and of the neighbouring joint [kg m²].
        position: at the start [rad].
        duration: of a group [s].
    """

    torque: float
    speed: float
    deflection: float
    stiffness: float
    motor_inertia: float
    neighbour_inertia: float
    position: float
    duration: float


@dataclass(frozen=True)
class ElasticStart:
    """Parameters of an effect to start from, and the joint's compliance [rad/Nm] that goes with them."""

    values: tuple[float, ...]
    compliance: float


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
        simulated: what the simulator does with it, if that is not u on its side.
        reference: where it is described.
        parameters: its parameters, in the order of `values` everywhere.
        linear: u is linear in the parameters.
        state: u depends on identified quantities (torque, link side, stiffness, f_mv) and is renewed as these
            change.
        scope: what it belongs to. The parameters of an episode are its size, start and end.
        fewest_joints: number of joints a robot needs for it to exist.
        joint_optional: it belongs to the set, but may be restricted to one joint.
        beside: an effect without which this one makes no sense on a joint.
        replaces: an effect that it refines and therefore replaces on its joint.
        twins: effects that the same data usually cannot tell from it.
        hidden_state: its state is seen by no encoder, so a good fit leaves larger traces of it.
        damps_deflection: it low-passes the path from joint torque to deflection, for sensor noise too.
        flexible: it can imitate unknown position effects (ripples of free order).
        relative: u is proportional to `motion.motor_viscous`, so that it moves with f_mv, too.
        memory: u depends on the time before the record.
        optimism: a refit is expected to gain at most this many times the effect's score.
        common: always in sight where effects are listed.
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
    fewest_joints: ClassVar[int] = 1
    joint_optional: ClassVar[bool] = False
    beside: ClassVar[str | None] = None
    replaces: ClassVar[str | None] = None
    twins: ClassVar[tuple[str, ...]] = ()
    hidden_state: ClassVar[bool] = False
    damps_deflection: ClassVar[bool] = False
    flexible: ClassVar[bool] = False
    relative: ClassVar[bool] = False
    memory: ClassVar[bool] = False
    optimism: ClassVar[float] = 3.0
    common: ClassVar[bool] = False
    example: ClassVar[tuple[float, ...]] = ()

    @property
    def units(self) -> dict[str, str]:
        """Parameter → its unit."""
        return {p.name: p.unit for p in self.parameters}

    @property
    def entry(self) -> Entry:
        """How it enters the equation."""
        entries: dict[Where, Entry] = {"motor": "torque", "sensing": "torque", "joint": "deflection"}
        return entries.get(self.where, "residual")

    @abstractmethod
    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        """u and ∂u/∂p at the parameters `values`, shape (P,)."""

    def guesses(self, context: Context, place: EffectTarget) -> list[Guess]:
        """Small versions of it to score, over a grid of its nonlinear parameters; here its slopes at zero."""
        terms = self.terms(context, place, np.zeros(len(self.parameters)))
        return [Guess(terms.entry, terms.joints, terms.slopes, np.array)]

    def targets(self, joints: int, payloads: Iterable[str]) -> list[EffectTarget]:
        """Everywhere it can sit in a robot of so many joints; an episode has to be searched for instead."""
        if joints < self.fewest_joints or self.scope == "episode":
            return []
        if self.scope == "payload":
            return [EffectTarget(payload=payload) for payload in payloads]
        return [EffectTarget()] if self.scope == "set" else [EffectTarget(j) for j in range(joints)]

    # -- judging a fit

    def possible(self, values: Array) -> bool:
        """Whether the parameters, shape (P,), go together; each one's own bounds are in `parameters`."""
        return True

    def at_bound(self, values: Array) -> bool:
        """Whether a parameter ended at a bound: a gain of −80 % is a search that ran away, not a finding."""
        edges = [
            (value, edge)
            for value, p in zip(values, self.parameters, strict=True)
            for edge in (0.0 if p.lower_occurs else p.lower, p.upper)
            if edge
        ]
        return any(np.isfinite(edge) and abs(value - edge) <= 1e-6 * abs(edge) for value, edge in edges)

    def credible(self, values: Array, evidence: EffectEvidence) -> bool:
        """Whether fitted parameters, shape (P,), could be real."""
        return not self.at_bound(values)

    def only_an_offset(self, evidence: EffectEvidence) -> bool:
        """Whether, in this motion, it does no more than shift the joint by a constant."""
        return False

    # -- its place in the search and in the noise model

    @property
    def absorbed_by_stiffness(self) -> bool:
        """Whether a fitted stiffness can take up part of it, so that its score comes out too low."""
        return self.where == "joint" and not self.flexible

    def elastic_starts(self, torque: Array, compliance: float, rough: float) -> list[ElasticStart]:
        """Starts that give back what the fitted compliance has absorbed of it.

        Args:
            torque: shape (N,), transmission torque of its joint [Nm].
            compliance, rough: fitted, and the set's rough one [rad/Nm].
        """
        return []

    def time_constant(self, values: Array, compliance: float) -> float:
        """Of the low-pass from joint torque to deflection [s], for an effect that damps the deflection."""
        return 0.0

    # -- simulation

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        """Parameters that make it clearly visible on a joint without dominating it."""
        return tuple(float(value) for value in self.sizes())

    def simulation(self, values: Array) -> Callable[[JointState], float] | None:
        """Its torque at one instant, for the simulator; None if it cannot be simulated.

        Only user-defined effects are asked: the library's are written down once more in the simulator. Motor
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
