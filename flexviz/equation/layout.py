"""Layout of the solver's parameter vector.

The solver uses the compliance c = 1/K: q = θ − c s is linear in c, a rigid joint is c = 0, and the residual
is nearly linear in c, so that a start value wrong by a factor of ten is corrected in about one step.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from flexviz.arrays import Array
from flexviz.effects import EFFECTS, ChosenEffect, LawEffect, choose_effects
from flexviz.measurements import MeasurementSet
from flexviz.model import INERTIAL_UNITS, EffectValue, FlexibleModel

INERTIAL_NAMES = tuple(INERTIAL_UNITS)


@dataclass(frozen=True)
class Layout:
    """Order of the solver's vector for n joints: Γ (10n), c, B, f_lv, f_mv (n each), effects' parameters."""

    joints: tuple[str, ...]  # names of the joints
    effects: tuple[ChosenEffect, ...] = ()  # the model's effects

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
        return slice(11 * self.n, 12 * self.n)

    @property
    def link_viscous(self) -> slice:
        return slice(12 * self.n, 13 * self.n)

    @property
    def motor_viscous(self) -> slice:
        return slice(13 * self.n, 14 * self.n)

    @property
    def effect_start(self) -> int:
        return 14 * self.n

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
        rows += [("stiffness", j, "Nm/rad") for j in self.joints]
        rows += [("motor_inertia", j, "kg m²") for j in self.joints]
        rows += [("link_viscous_friction", j, "Nm s/rad") for j in self.joints]
        rows += [("motor_viscous_friction", j, "Nm s/rad") for j in self.joints]
        for effect in self.effects:
            specs = EFFECTS[effect.effect].parameters
            rows += [(f"{effect.effect}.{p.name}", self.joint_name(effect), p.unit) for p in specs]
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
        return FlexibleModel(
            self.joints, 1 / x[self.compliance], x[self.motor_inertia], x[self.link_viscous],
            x[self.motor_viscous], x[self.inertial].reshape(self.n, 10), tuple(values),
        )  # fmt: skip

    def vector(self, model: FlexibleModel) -> Array:
        """The model as a vector; effects that it does not have are zero."""
        x = np.zeros(self.size)
        x[self.inertial] = model.inertial.ravel()
        x[self.compliance] = 1 / model.stiffness
        x[self.motor_inertia] = model.motor_inertia
        x[self.link_viscous] = model.link_viscous_friction
        x[self.motor_viscous] = model.motor_viscous_friction
        known = {(e.effect, e.joint, e.group, e.payload): e.parameters for e in model.effects}
        for effect, where in self.effect_slices():
            key = (effect.effect, self.joint_name(effect), effect.group, effect.payload)
            values = known.get(key, {})
            x[where] = [values.get(p.name, 0.0) for p in EFFECTS[effect.effect].parameters]
        return x


def layout_of(measurements: MeasurementSet, effects: Iterable[str] = ()) -> Layout:
    """Layout of a set's model with additional effects; InputError for one that does not exist."""
    groups = [group.name for group in measurements.groups]
    wanted = (*measurements.effects, *effects)
    return Layout(
        measurements.joints, choose_effects(wanted, measurements.joints, measurements.carried, groups)
    )
