"""The parameters of joints that follow goals, with their standard errors."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flexviz.analysis.identification import IDENTIFICATION, grade
from flexviz.analysis.servo.fit import ServoData, Slopes, slopes_at
from flexviz.base.arrays import Array, Bools
from flexviz.base.units import joint_unit
from flexviz.content.records import Combination, EffectEntry, EffectParameter, Grade, ParameterEstimate
from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import EFFECTS, ChosenEffect
from flexviz.model.servo import (
    GAIN,
    INDEX,
    LOG,
    NAMES,
    SCALED,
    SIZE,
    START,
    in_newtons,
    of_effect,
    servo_model,
)
from flexviz.robot.model import FlexibleModel

UNITS = {"gain": "Nm/rad", "motor_inertia": "kg m²", "motor_viscous_friction": "Nm s/rad"}


@dataclass(frozen=True, eq=False)
class ServoEstimate:
    """A fitted model.

    Attributes:
        free: (P, n) parameters that were fitted.
        values: (P, n).
        effects: besides the gain, in the order of their joints.
        determined: (n,) whether the gain, and with it the scale of all torques of a joint, is determined.
    """

    measurements: MeasurementSet
    data: ServoData
    weight: Array
    free: Bools
    values: Array
    effects: tuple[ChosenEffect, ...]
    determined: Bools

    @cached_property
    def slopes(self) -> Slopes:
        """Derivatives of the free motion."""
        return slopes_at(self.data, self.free, self.values, self.weight)

    @cached_property
    def covariance(self) -> Array:
        """(U, U) of the unknowns as they are fitted.

        Of each unknown the larger variance of two counts: from the independent samples, and from how much the
        stretches disagree, which includes what the model lacks; and what even right laws leave.
        """
        found = self.slopes
        inverse = np.linalg.pinv(found.hessian, hermitian=True)
        own = np.maximum(np.diag(inverse), 1e-300)
        wider = np.sqrt((np.maximum(found.spread(), own) + found.tolerated) / own)
        return np.asarray(inverse * np.outer(wider, wider), float)

    def std(self, p: int, j: int) -> float:
        """Standard error of a parameter, of its logarithm where it is fitted as that."""
        at = self.slopes.place[p, j]
        return float(np.sqrt(self.covariance[at, at])) if at >= 0 else 0.0

    def graded(self, p: int, j: int) -> tuple[float, float, Grade]:
        """Value, standard error and grade of a parameter in SI units."""
        value, std = float(self.values[p, j]), self.std(p, j)
        at = self.slopes.place[p, j]
        share = std**2 / self.data.spread[p, j] ** 2 if at >= 0 else 0.0
        if LOG[p]:
            found = grade("effect", std, 1.0, share)
            return value, value * std, found if at >= 0 else "yes"
        scale = max(abs(value), IDENTIFICATION.effect_floor * float(self.data.spread[p, j]))
        found = grade("effect", std, scale, share)
        std *= abs(in_newtons(self.values, p, j) / value) if value else 1.0
        return in_newtons(self.values, p, j), std, found

    def parameters(self) -> tuple[ParameterEstimate, ...]:
        """All of them, the joints' own first."""
        out = []
        joints = self.measurements.joints
        for name in ("motor_inertia", "motor_viscous_friction"):
            out += [self.estimate(INDEX[name], j, name) for j in range(len(joints))]
        out += [self.estimate(INDEX["gain"], j, f"{GAIN}.gain") for j in range(len(joints))]
        for key in self.effects:
            out += [self.estimate(p, key.joint or 0, NAMES[p]) for p in of_effect(key.effect)]
        return tuple(out)

    def estimate(self, p: int, j: int, name: str) -> ParameterEstimate:
        value, std, found = self.graded(p, j)
        slides = bool(self.measurements.robot.prismatic[j])
        tied: tuple[str, ...] = ()
        if SCALED[p] and not self.determined[j]:
            found = "no"
            tied = () if NAMES[p] == "gain" else (f"{GAIN}.gain:{self.measurements.joints[j]}",)
        return ParameterEstimate(
            name, self.measurements.joints[j], value, std, joint_unit(self.unit(p), slides), found,
            start=float(START[p]), tied_to=tied,
            at_bound=bool(SIZE[p] and value == 0.0 and self.free[p, j]),
        )  # fmt: skip

    def unit(self, p: int | np.intp) -> str:
        """SI, of a joint that turns."""
        effect, dot, name = NAMES[p].partition(".")
        return EFFECTS[effect].units[name] if dot else UNITS[effect]

    @property
    def link_inertia(self) -> Array:
        """(n,) of the masses about each joint, at most poses [kg m²]."""
        found: Array = np.median(self.data.motion.own, axis=(0, 2))
        return found

    def ratios(self) -> tuple[Combination, ...]:
        """What is determined of joints whose gain is not: ratios to the gain."""
        out = []
        gain = INDEX["gain"]
        for j, joint in enumerate(self.measurements.joints):
            if self.determined[j]:
                continue
            for p in np.flatnonzero(self.free[:, j]):
                if not SCALED[p] or p == gain:
                    continue
                a, b = self.slopes.place[p, j], self.slopes.place[gain, j]
                cov = self.covariance
                size = float(self.values[p, j])
                whole = size + (self.link_inertia[j] if p == INDEX["motor_inertia"] else 0.0)
                value = whole / float(self.values[gain, j])
                own = (size if LOG[p] else 1.0) / max(whole, 1e-12)
                variance = own**2 * cov[a, a] + cov[b, b] - 2 * own * cov[a, b]
                std = float(np.sqrt(max(variance, 0.0)))
                unit = f"{self.unit(p)} / (Nm/rad)"
                more = " + links" if p == INDEX["motor_inertia"] else ""
                label = f"({NAMES[p]}:{joint}{more}) / {GAIN}.gain:{joint}"
                out.append(Combination(label, value, value * std, unit, grade("effect", std, 1.0, 0.0)))
        return tuple(out)

    def model(self) -> FlexibleModel:
        """The model of a robot whose joints have no elasticity."""
        return servo_model(self.measurements.robot, self.values, self.effects)

    def entries(self) -> tuple[EffectEntry, ...]:
        """The effects with values and standard errors, each joint's gain first."""
        joints = self.measurements.joints
        out = []
        for j, joint in enumerate(joints):
            value, std, found = self.graded(INDEX["gain"], j)
            out.append(EffectEntry(GAIN, {"gain": EffectParameter(value, std, "Nm/rad", found)}, joint))
        for key in self.effects:
            out.append(EffectEntry(key.effect, self.of_effect(key), joints[key.joint or 0]))
        return tuple(out)

    def of_effect(self, key: ChosenEffect) -> dict[str, EffectParameter]:
        """An effect's parameters."""
        out = {}
        for p in of_effect(key.effect):
            j = key.joint or 0
            value, std, _ = self.graded(p, j)
            unknown: Grade | None = "no" if SCALED[p] and not self.determined[j] else None
            out[NAMES[p].partition(".")[2]] = EffectParameter(value, std, self.unit(p), unknown)
        return out
