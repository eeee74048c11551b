"""Fits of joints that follow goals, servo by servo: kept, and different servos at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from flexviz.analysis.diagnosis import THRESHOLDS, Criterion, criterion_of
from flexviz.analysis.motion import MOTION, Residuals, deviations
from flexviz.analysis.servo.fit import ServoData, ServoFit, fit_servos
from flexviz.base.arrays import Array, Bools, Indices
from flexviz.data.measurements import MeasurementSet
from flexviz.data.noise import segments_noise
from flexviz.model.effects import ChosenEffect
from flexviz.model.servo import (
    ABSENT,
    CENTER,
    INDEX,
    NAMES,
    OWN,
    PARAMETERS,
    SCALED,
    SERVO_EFFECTS,
    SHARED,
    START,
    TORQUE,
    DrivenMotion,
    absent,
    driven_motion,
    free_motion,
    of_effect,
)  # fmt: skip

STIFFER = 3.0  # times the gain, where a limit is tried
REFINED = 15  # steps of a fit, at most
EVIDENCE = THRESHOLDS.evidence

Keys = frozenset[ChosenEffect]
Asked = tuple[int, Keys, Array]
"""Owner, its effects, and the values (P, n) from which a fit starts."""


@dataclass(frozen=True, eq=False)
class ServoState:
    """The joints of one servo, or one joint, with certain effects.

    Attributes:
        values: (P, n) of which the columns of these joints are valid.
        deviation, held_out: (n,) likewise, what is left of all groups and of the held-out ones [rad].
    """

    values: Array
    deviation: Array
    held_out: Array


@dataclass(frozen=True, eq=False)
class ServoModel:
    """Effects of all joints; the fit of each servo is `states[owner]`."""

    keys: Keys
    states: dict[int, ServoState]

    def values(self, owner: Indices) -> Array:
        """(P, n)."""
        return np.stack([self.states[int(o)].values[:, j] for j, o in enumerate(owner)], axis=1)


class ServoFits:
    """Fits of the servos of one set; different servos are fitted at once.

    Attributes:
        given: effects of the set's own model.
        data: what is fitted.
        known: owner and effects of a servo -> its fit.
        criterion, samples: J of every model, and the independent samples (n,) of each joint.
    """

    def __init__(
        self,
        measurements: MeasurementSet,
        check: Callable[[], None] = lambda: None,
        given: Keys = frozenset(),
    ) -> None:
        self.measurements, self.check, self.given = measurements, check, given
        motion = driven_motion(measurements.robot, measurements.groups)
        held = np.array([measurements.groups[g].validation for g in motion.group])
        self.noise = segments_noise([s for g in measurements.groups for s in g.segments])[0]
        used = motion.used
        away = np.square(motion.goal - motion.theta) * used
        self.spread = np.sqrt(away.sum(axis=(0, 2)) / np.maximum(used.sum(axis=(0, 2)), 1))  # [rad]
        self.torque = START[INDEX["gain"]] * self.spread  # [Nm] that joints usually have
        unit, center, spread = self.scales(motion)
        self.data = ServoData(motion, ~held, owners(measurements), center, spread, unit)
        self.least = np.hypot(self.noise, MOTION.tolerance * self.spread)
        self.known: dict[tuple[int, Keys], ServoState] = {}
        self.banned: Keys = frozenset()
        self.refined: set[tuple[int, Keys]] = set()
        self.samples = np.full(measurements.robot.n, 100.0)
        self.criterion: Criterion = Criterion(self.samples, self.least, self.choices)

    @property
    def n(self) -> int:
        return self.measurements.robot.n

    @property
    def choices(self) -> int:
        """Effects that may be added, at all joints."""
        return len(SERVO_EFFECTS) * len(set(self.data.owner.tolist()))

    def refresh(self, values: Array) -> None:
        """Take what the joints do to each other from the free motion of a model, (P, n), where it is fast.

        There the measured motion is noise; nothing that was fitted before holds exactly.
        """
        theta = free_motion(self.whole, values[:, None])[0]
        read = self.measurements
        self.data = replace(self.data, motion=driven_motion(read.robot, read.groups, theta))
        self.known.clear()
        self.refined.clear()

    @cached_property
    def whole(self) -> DrivenMotion:
        """Each stretch without a gap as it is."""
        return driven_motion(self.measurements.robot, self.measurements.groups, whole=True)

    def renew(self, fit: ServoFit) -> bool:
        """Measure anew how many samples are independent; whether that changes what counts."""
        found = criterion_of(self.residuals(fit.error), self.least, self.choices, MOTION.outlier)
        grown = bool(np.any(found.samples > 1.5 * self.criterion.samples))
        self.criterion, self.samples = found, found.samples
        return grown

    def own(self, keys: Keys, owner: int) -> Keys:
        """Those of the effects that are one servo's."""
        return frozenset(k for k in keys if int(self.data.owner[k.joint]) == owner)

    def of_joints(self, key: ChosenEffect) -> list[ChosenEffect]:
        """An effect of a servo as the effects of its joints."""
        return [replace(key, joint=int(j)) for j in self.joints(key, of_effect(key.effect)[0])]

    def of_servo(self, key: ChosenEffect) -> ChosenEffect:
        """The effect of a servo to which that of a joint belongs."""
        shared = SHARED[of_effect(key.effect)[0]]
        return replace(key, joint=int(self.data.owner[key.joint])) if shared else key

    def model(self, keys: Keys) -> ServoModel:
        """A model whose servos have been fitted."""
        owners = set(self.data.owner.tolist())
        return ServoModel(keys, {o: self.known[o, self.own(keys, o)] for o in owners})

    def scales(self, motion: DrivenMotion) -> tuple[Array, Array, Array]:
        """Usual sizes, and centre and spread of what is likely, (P, n) each."""
        torque = np.where(TORQUE[:, None], self.torque, 1.0)
        unit = np.array([np.median(np.abs(p.tried)) for p in PARAMETERS])[:, None] * torque
        center = np.repeat(CENTER[:, None], self.n, axis=1)
        speed = np.abs(np.diff(motion.goal, axis=0)) / motion.step
        center[INDEX["torque_limit.limit"]] = np.log(3 * self.torque)
        center[INDEX["goal_speed_limit.speed"]] = np.log(np.maximum(speed.max(axis=(0, 2)), 1e-6))
        return unit, center, np.array([p.spread for p in PARAMETERS])[:, None] * torque

    def starting(self, values: Array, added: Iterable[ChosenEffect], which: int = 0) -> Array:
        """Values from which a fit with more effects starts; `which` of those that are tried."""
        out = values.copy()
        for key in added:
            for k in of_effect(key.effect):
                joints, tried = self.joints(key, k), PARAMETERS[k].tried
                if np.any(values[k, joints] != ABSENT[k]):
                    continue
                if stiffer := PARAMETERS[k].stiffer:  # what saturates was taken for a soft servo
                    out[INDEX["gain"], joints] *= STIFFER if which >= stiffer else 1.0
                out[k, joints] = self.first(k, joints, values, tried[which % len(tried)])
        return out

    def first(self, parameter: int, joints: Indices, values: Array, tried: float) -> Array:
        """Where the fit of a parameter starts, on these joints."""
        name, motion = NAMES[parameter], self.data.motion
        gain = values[INDEX["gain"]]
        if name == "torque_limit.limit":
            size = np.abs(motion.goal - motion.theta) * gain[:, None]
        elif name == "goal_speed_limit.speed":
            size = np.abs(np.diff(motion.goal, axis=0)) / motion.step
        else:
            scale = self.spread * gain if TORQUE[parameter] else np.ones(self.n)
            return tried * scale[joints]
        rows = [size[:, j][size[:, j] > 0] for j in joints]
        return np.array([float(np.quantile(one, tried)) if len(one) else 1.0 for one in rows])

    def placed(self, model: ServoModel, asked: Sequence[Asked]) -> list[Asked]:
        """The same, each from the best of the values that are tried for what is new."""
        if not asked:
            return []
        options: list[Asked] = []
        counts = []
        for owner, keys, start in asked:
            new = keys - self.own(model.keys, owner)
            count = max((len(PARAMETERS[k].tried) for key in new for k in of_effect(key.effect)), default=1)
            options += [(owner, keys, self.starting(start, new, i)) for i in range(count)]
            counts.append(count)
        slots = self.slots(options)
        values, motion = np.stack([self.joined(slot, options)[1] for slot in slots], axis=1), self.data.thin
        error = np.where(motion.used, free_motion(motion, values) - motion.theta, 0.0)
        nats = np.log(np.square(error).sum(axis=(1, 3)) + 1e-300)  # (V, n)
        found = np.empty(len(options))
        for slot, row in zip(slots, nats, strict=True):
            for owner, at in slot.items():
                found[at] = (row * self.samples)[self.data.owner == owner].sum()
        ends = np.cumsum([0, *counts])
        return [options[a + int(np.argmin(found[a:b]))] for a, b in pairwise(ends)]

    def slots(self, asked: Sequence[Asked]) -> list[dict[int, int]]:
        """Which of them are simulated at once: owner -> number, different servos in one."""
        slots: list[dict[int, int]] = []
        filled: dict[int, int] = {}
        for at, (owner, _, _) in enumerate(asked):
            k = filled.get(owner, 0)
            filled[owner] = k + 1
            if k == len(slots):
                slots.append({})
            slots[k][owner] = at
        return slots

    def joined(self, slot: dict[int, int], asked: Sequence[Asked]) -> tuple[Bools, Array]:
        """What is fitted, and values, (P, n) each, of several servos."""
        free = self.free(frozenset(k for at in slot.values() for k in asked[at][1]))
        values = self.rough
        for j, owner in enumerate(self.data.owner.tolist()):
            if owner in slot:
                values[:, j] = asked[slot[owner]][2][:, j]
            else:
                free[:, j] = False
        has = free | (np.arange(len(values)) < len(OWN))[:, None]
        return free, np.where(has, values, self.rough)

    def joints(self, key: ChosenEffect, parameter: int) -> Indices:
        """The joints on which an effect of a servo has a parameter: all of that servo, or one."""
        same = np.flatnonzero(self.data.owner == self.data.owner[key.joint])
        return same if SHARED[parameter] else np.array([key.joint])

    def free(self, keys: Keys) -> Bools:
        """(P, n) what is fitted."""
        free = np.zeros((len(NAMES), self.n), bool)
        drive = self.measurements.drive
        for name in OWN:
            free[INDEX[name]] = name != "gain" or drive is None or drive.kp is None
        for key in keys:
            for k in of_effect(key.effect):
                free[k, self.joints(key, k)] = True
        return free

    @property
    def rough(self) -> Array:
        """(P, n) values without effects, with the gains that the set states."""
        values, drive = absent(self.n), self.measurements.drive
        if drive is not None and drive.kp is not None:
            values[INDEX["gain"]] = drive.kp
        return values

    def fitted(self, asked: Sequence[Asked], steps: int, *, thin: bool = False) -> list[ServoFit]:
        """Fit servos with effects, from values (P, n); different servos are fitted at once.

        `thin`: by some of the stretches.
        """
        if not asked:
            return []
        slots = self.slots(asked)
        models = [self.joined(slot, asked) for slot in slots]
        motion = self.data.thin if thin else self.data.some
        fits = fit_servos(self.data, models, steps, self.samples, motion, check=self.check)
        for slot, fit in zip(slots, fits, strict=True):
            parts = self.residuals(fit.error)
            sigma, held = deviations(parts, MOTION.outlier), deviations(parts[-1:], MOTION.outlier)
            state = ServoState(fit.values, sigma, held)
            for owner, at in slot.items():
                place = owner, asked[at][1]
                before, mine = self.known.get(place), self.data.owner == owner
                if before is None or self.nats(state)[mine].sum() < self.nats(before)[mine].sum():
                    self.known[place] = state
        return fits

    def nats(self, state: ServoState) -> Array:
        return self.criterion.nats(state.deviation)

    def residuals(self, error: Array) -> list[Residuals]:
        """Of the fit groups, then of the held-out ones if there are any; `error` (T, n, C) [rad]."""
        motion, out = self.data.motion, []
        for chosen in (self.data.fitted, ~self.data.fitted):
            if not chosen.any():
                continue
            at = np.flatnonzero(chosen)
            T = error.shape[0]
            values = error[:, :, at].transpose(2, 0, 1).reshape(-1, self.n)
            used = motion.used[:, :, at].transpose(2, 0, 1).reshape(-1, self.n)
            out.append(Residuals(values, used, [slice(k * T, (k + 1) * T) for k in range(len(at))]))
        return out

    def scale_determined(self, free: Bools, values: Array) -> Bools:
        """(n,) whether torques of twice or half the size would leave clearly more of a joint's motion.

        Only a known mass tells them apart. What a model leaves is of its own making, and no number of samples
        makes a small part of it count.
        """
        held = free.copy()
        held[INDEX["gain"]] = False
        factors = np.where(SCALED, 1.0, 0.0)[:, None]
        models = [(held, values * np.exp(factors * turn)) for turn in (0.0, np.log(2.0), -np.log(2.0))]
        fits = fit_servos(self.data, models, REFINED, self.samples, check=self.check)
        own, twice, half = (deviations(self.residuals(fit.error), MOTION.outlier) for fit in fits)
        clear = np.minimum(twice, half) > (1 + EVIDENCE.share) * np.maximum(own, self.least)
        return np.array([clear[self.data.owner == o].any() for o in self.data.owner]) | ~free[INDEX["gain"]]


def owners(measurements: MeasurementSet) -> Indices:
    """(n,) index of the first joint that has the same servo."""
    out = np.arange(measurements.robot.n)
    same = measurements.drive.same if measurements.drive is not None else ()
    for names in same:
        at = [measurements.joints.index(name) for name in names]
        out[at] = min(at)
    return out
