"""Layout of the solver's parameter vector.

The solver uses the compliance c = 1/K: q = θ − c s is linear in c, a rigid joint is c = 0, and the residual
is nearly linear in c, so that a start value wrong by a factor of ten is corrected in about one step.

A rigid joint keeps its place in the vector, held at `RIGID`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from flexviz.base.arrays import Array, Bools
from flexviz.base.errors import InputError
from flexviz.base.units import joint_unit
from flexviz.checks import behind_gear
from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import EFFECTS, ChosenEffect, LawEffect, choose_effects
from flexviz.robot.model import INERTIAL_UNITS, JOINT_UNITS, EffectValue, FlexibleModel

RIGID = 1e-12  # [rad/Nm] of a rigid joint: a nanometre at the end of a long arm under any torque


@dataclass(frozen=True)
class Layout:
    """Order of the solver's vector for n joints: Γ (10n), c, B, f_lv, f_mv (n each), effects' parameters.

    Without motors (τ was measured behind the gear) there is no B and no f_mv: their slices are empty. Of
    joints without elasticity c is held at 0 and all viscous friction is f_mv; of joints without a torque B
    and f_mv are held.
    """

    joints: tuple[str, ...]  # names of the joints
    effects: tuple[ChosenEffect, ...] = ()  # the model's effects
    motors: bool = True  # whether τ is that of the motors
    rigid: tuple[int, ...] = ()  # joints without elasticity
    no_torque: tuple[int, ...] = ()  # joints whose equation is left out
    sliding: tuple[int, ...] = ()  # prismatic joints: units of m and N

    @property
    def fitted(self) -> Bools:
        """Joints whose torque is fitted, shape (n,)."""
        return ~np.isin(np.arange(self.n), self.no_torque)

    @property
    def held(self) -> Bools:
        """Parameters that this model does not have, shape (P,)."""
        held = np.zeros(self.size, bool)
        held[self.compliance.start + np.array(self.rigid, int)] = True
        for side in (self.motor_inertia, self.motor_viscous):
            if side.stop > side.start:
                held[side.start + np.array(self.no_torque, int)] = True
        if self.motors:
            held[self.link_viscous.start + np.array(self.rigid, int)] = True
        return held

    @property
    def n(self) -> int:
        return len(self.joints)

    @property
    def inertial(self) -> slice:
        return slice(0, 10 * self.n)

    @property
    def compliance(self) -> slice:
        return slice(10 * self.n, 11 * self.n)

    @property
    def motor_inertia(self) -> slice:
        return slice(11 * self.n, 11 * self.n + self._motors)

    @property
    def link_viscous(self) -> slice:
        first = self.motor_inertia.stop
        return slice(first, first + self.n)

    @property
    def motor_viscous(self) -> slice:
        first = self.link_viscous.stop
        return slice(first, first + self._motors)

    @property
    def effect_start(self) -> int:
        return self.motor_viscous.stop

    @property
    def _motors(self) -> int:
        return self.n if self.motors else 0

    def motor_side(self, x: Array) -> tuple[Array, Array]:
        """B [kg m²] and f_mv [Nm s/rad] of every joint, (n,) each; zero without motors, or a torque."""
        if not self.motors:
            return np.zeros(self.n), np.zeros(self.n)
        return x[self.motor_inertia] * self.fitted, x[self.motor_viscous] * self.fitted

    def with_effects(self, effects: Iterable[ChosenEffect] = ()) -> Layout:
        """The layout with other effects, by default with none."""
        return replace(self, effects=tuple(effects))

    def can_have(self, effect: ChosenEffect) -> bool:
        """Whether an effect can act: none without a torque, no elastic or link-side one on a rigid joint."""
        if effect.joint in self.no_torque:
            return False
        return effect.joint not in self.rigid or not EFFECTS[effect.effect].behind_spring

    @property
    def has_reversals(self) -> bool:
        """Whether the torque of an effect jumps where a velocity or a torque changes sign."""
        laws = (EFFECTS[effect.effect] for effect in self.effects)
        return any(isinstance(law, LawEffect) and not law.smooth for law in laws)

    def joint_name(self, effect: ChosenEffect) -> str | None:
        """Name of an effect's joint; None for effects without a joint."""
        return None if effect.joint is None else self.joints[effect.joint]

    def labels(self) -> list[str]:
        """A unique label of every entry: "stiffness:joint1", "payload_error.relative_mass_error:p2"."""
        rows = self.names()
        out = [f"{name}:{joint}" if joint else name for name, joint, _ in rows]
        for effect, where in self.effect_slices():
            for k in range(where.start, where.stop):
                extra = [part for part in (effect.payload, effect.group) if part]
                out[k] = ":".join([out[k], *extra])
        return out

    def effect_slices(self) -> list[tuple[ChosenEffect, slice]]:
        """Each effect with the place of its parameters."""
        out, at = [], self.effect_start
        for effect in self.effects:
            width = len(EFFECTS[effect.effect].parameters)
            out.append((effect, slice(at, at + width)))
            at += width
        return out

    def effect_slice(self, effect: ChosenEffect) -> slice:
        """Where the parameters of an effect are."""
        return dict(self.effect_slices())[effect]

    @property
    def size(self) -> int:
        return self.effect_start + sum(len(EFFECTS[e.effect].parameters) for e in self.effects)

    def names(self) -> list[tuple[str, str | None, str]]:
        """(name, joint, unit) of every entry, as in the JSON contract; c is listed as the stiffness."""
        rows: list[tuple[str, str | None, str]] = [
            (name, j, unit) for j in self.joints for name, unit in INERTIAL_UNITS.items()
        ]
        for name, unit in JOINT_UNITS.items():
            if self.motors or not name.startswith("motor_"):
                rows += [(name, j, joint_unit(unit, k in self.sliding)) for k, j in enumerate(self.joints)]
        for effect in self.effects:
            specs, slides = EFFECTS[effect.effect].parameters, effect.joint in self.sliding
            rows += [(f"{effect.effect}.{p.name}", self.joint_name(effect), p.unit_on(slides)) for p in specs]
        return rows

    def model(self, x: Array) -> FlexibleModel:
        """The vector as a model."""
        values = [
            EffectValue(
                effect.effect,
                self.joint_name(effect),
                {p.name: float(v) for p, v in zip(EFFECTS[effect.effect].parameters, x[where], strict=True)},
                effect.group,
                effect.payload,
            )
            for effect, where in self.effect_slices()
        ]
        inertia, viscous = (
            x[side] if self.motors else np.zeros(self.n) for side in (self.motor_inertia, self.motor_viscous)
        )
        stiffness = 1 / x[self.compliance]
        stiffness[list(self.rigid)] = np.inf
        return FlexibleModel(
            self.joints, stiffness, inertia, x[self.link_viscous],
            viscous, x[self.inertial].reshape(self.n, 10), tuple(values),
        )  # fmt: skip

    def vector(self, model: FlexibleModel) -> Array:
        """The model as a vector; effects that it does not have are zero."""
        x = np.zeros(self.size)
        x[self.inertial] = model.inertial.ravel()
        x[self.compliance] = np.maximum(1 / model.stiffness, RIGID)
        x[self.compliance][list(self.rigid)] = RIGID
        x[self.link_viscous] = model.link_viscous_friction
        if self.motors:
            x[self.motor_inertia] = model.motor_inertia
            x[self.motor_viscous] = model.motor_viscous_friction
        known = {(e.effect, e.joint, e.group, e.payload): e.parameters for e in model.effects}
        for effect, where in self.effect_slices():
            key = (effect.effect, self.joint_name(effect), effect.group, effect.payload)
            values = known.get(key, {})
            x[where] = [values.get(p.name, 0.0) for p in EFFECTS[effect.effect].parameters]
        return x


def layout_of(measurements: MeasurementSet, effects: Iterable[str] = ()) -> Layout:
    """Layout of a set's model with additional effects; InputError for one that does not exist.

    Effects that are wanted on every joint are left out where a rigid joint, or one without a torque, cannot
    have them.
    """
    groups = [group.name for group in measurements.groups]
    wanted = (*measurements.effects, *effects)
    chosen = choose_effects(wanted, measurements.joints, measurements.carried, groups)
    rigid, no_torque = (
        tuple(map(measurements.joints.index, names)) for names in (measurements.rigid, measurements.no_torque)
    )
    sliding = tuple(map(int, np.flatnonzero(measurements.robot.prismatic)))
    layout = Layout(measurements.joints, (), not behind_gear(measurements), rigid, no_torque, sliding)
    for effect in chosen:
        if not layout.can_have(effect) and effect.text(layout.joints) in wanted:
            why = "has no torque" if effect.joint in no_torque else "is rigid"
            joint = layout.joint_name(effect)
            raise InputError(f'effect "{effect.text(layout.joints)}": {joint} {why} in this set\'s model')
    return layout.with_effects(filter(layout.can_have, chosen))
