"""What was found, effect by effect: the staircase of models, and the evidence of each step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.course import Course, SearchEnd
from flexviz.analysis.diagnosis.criterion import Gain, confidence, split, unexplained
from flexviz.analysis.diagnosis.elimination import by_weight
from flexviz.analysis.diagnosis.prediction_errors import PredictionErrorBand, PredictionErrors
from flexviz.analysis.diagnosis.result import Evidence, Finding, Step
from flexviz.analysis.diagnosis.search import Tried
from flexviz.analysis.diagnosis.thresholds import THRESHOLDS
from flexviz.analysis.diagnosis.ties import ties
from flexviz.analysis.diagnosis.unknown_curve import is_curve
from flexviz.analysis.estimation import Covariance
from flexviz.analysis.identification import Estimate
from flexviz.analysis.laws import laws_through_data
from flexviz.analysis.motion import MOTION, Known
from flexviz.base.parallel import shared
from flexviz.content.records import Absorbed, EffectEntry, EffectParameter, Family, Tie, Verdict
from flexviz.content.wording import step_shares
from flexviz.model.effects import EFFECT_FAMILIES, EFFECTS, ChosenEffect, family_of
from flexviz.model.equation import Layout

Array = NDArray[np.float64]

LIMITS = THRESHOLDS.criterion


@dataclass(frozen=True, eq=False)
class Stair:
    """One model of the staircase.

    Attributes:
        added: the effect that it has more than the one before; None for the first.
        layout, x: the model and its parameters, shape (P,).
        covariance: of them.
        errors: its residuals.
        chance: covariance without what the model lacks; None: it is the same.
        estimate: of the estimator; None for models on the way.
    """

    added: ChosenEffect | None
    layout: Layout
    x: Array
    covariance: Covariance
    errors: PredictionErrors
    chance: Covariance | None = None
    estimate: Estimate | None = None


def estimated(course: Course, layout: Layout, x: Array) -> Stair:
    """A model as `identify` estimates it, from x, shape (P,)."""
    return stair_of(course, course.estimator.estimate(layout, x, known=True))


def stair_of(course: Course, found: Estimate) -> Stair:
    """A model of the estimator."""
    layout, (covariance, chance) = found.layout, found.covariances
    added = [e for e in layout.effects if e not in course.own.effects]
    errors = course.band.errors(Known(layout, found.x), found.first_phase)
    return Stair(added[-1] if added else None, layout, found.x, covariance, errors, chance, found)


def staircase(course: Course, end: SearchEnd, last: Stair) -> list[Stair]:
    """The set's own model, then one effect more at a time, the weightiest first, up to the `last` model."""
    own, view, fit = course.own, course.view, end.coarse.fit
    added = [e for e in last.layout.effects if e not in own.effects]
    order = by_weight(view.linearised(end.coarse), [e for e in added if not is_curve(e)], view.context.spread)
    order += [(curve, fit.x) for curve in added if is_curve(curve)]
    effects = [None, *(effect for effect, _ in order)]

    def stair(count: int) -> Stair:
        layout = own.with_effects((*own.effects, *(e for e, _ in order[:count])))
        start = fit.towards(order[count][1], layout)
        found = view.context.fit(layout, start)
        covariance = found.chance(found.at_bound)
        errors = course.band.errors(found, view.context.first_phase)
        return Stair(effects[count], layout, found.x, covariance, errors)

    if not order:
        return [replace(last, added=None)]
    first = estimated(course, own, fit.towards(order[0][1], own))
    stairs = shared(stair, range(1, len(order))[::-1])[::-1]  # the largest, which take longest, first
    return [first, *stairs, replace(last, added=effects[-1])]


def findings(course: Course, end: SearchEnd, stairs: Sequence[Stair]) -> list[Finding]:
    """One finding per added effect, in the order of the staircase."""
    view, n, last, found = course.view, course.own.n, stairs[-1], list[Finding]()
    gains = course.gains(end)
    at = course.fine.criterion if end.at_noise else view.criterion
    # a band that allowed for missing effects would hide them
    band = (last.chance or last.covariance).matrix
    laws = laws_through_data(course.measurements, last.layout, last.x, band)
    shares = step_shares([stair.errors for stair in stairs], course.measurements.torque_spread)[1:]
    for (before, after), share in zip(pairwise(stairs), shares, strict=True):
        effect = after.added
        assert effect is not None
        need = gains.get(effect, Gain(0.0, np.zeros(n), 0.0))
        left = 0.0 if end.at_noise else unexplained(need, at.samples, effect.joint)
        near = rivals(course.trace, effect)
        tied = tuple(ties(view, end.coarse, effect, list(near)))
        sure = 0.0 if is_curve(effect) else confidence(need.delta, left)
        family = family_in(effect.effect, tied, sure)
        found.append(replace(
            finding(effect, before, after, last, course.band),
            confidence=split(sure, list(near.values())), family=family,
            inseparable_from=tied, gain=float(need.delta), absorbed=absorbed(before, after), share=share,
            features=(float(need.delta), left), law=laws.get(effect),
        ))  # fmt: skip
    return found


def rivals(trace: Sequence[Tried], effect: ChosenEffect) -> dict[str, float]:
    """Laws for which an effect was exchanged without a clear loss, and what each gained [nats]."""
    return {
        new.effect: move.gain.delta
        for move in trace
        if move.kind == "swap" and effect in move.removed and abs(move.gain.delta) < LIMITS.temperature
        for new in move.added
        if new.joint == effect.joint
    }


def finding(
    effect: ChosenEffect, before: Stair, after: Stair, last: Stair, band: PredictionErrorBand
) -> Finding:
    """An effect that a stair adds, with its parameters in the last model, and no confidence yet."""
    return Finding(
        effect.effect, last.layout.joint_name(effect), effect.group, effect.payload,
        score=removed_share(before.errors, after.errors), confidence=0.0,
        parameters=own_parameters(effect, last),
        evidence=explained_residual(effect, before, after, band),
    )  # fmt: skip


def family_in(effect: str, tied: Sequence[Tie], sure: float) -> Family | None:
    """The family of an effect, if it has one: its members that tie in these data, or all of them."""
    name = family_of(effect)
    if name is None:
        return None
    rivals = {tie.effect for tie in tied}
    same = tuple(member for member in EFFECT_FAMILIES[name] if member in rivals or member == effect)
    return Family(name, len(same) > 1, same if len(same) > 1 else EFFECT_FAMILIES[name], sure)


def own_parameters(effect: ChosenEffect, stair: Stair) -> dict[str, EffectParameter]:
    """An effect's parameters in a model."""
    where, slides = stair.layout.effect_slice(effect), effect.joint in stair.layout.sliding
    std = stair.covariance.standard_errors[where]
    rows = zip(EFFECTS[effect.effect].parameters, stair.x[where], std, strict=True)
    return {p.name: EffectParameter(float(v), float(e), p.unit_on(slides)) for p, v, e in rows}


def removed_share(before: PredictionErrors, after: PredictionErrors) -> float:
    """Share of the held-out error above the noise that a step removed; joints count by their torque."""
    weight = np.array([1 / one if one > 0 else 0.0 for one in before.spread]) if before.spread else 1.0
    floor = np.array(before.noise_floor)

    def excess(errors: PredictionErrors) -> float:
        rms = np.array(errors.stated)
        return float((np.maximum(rms**2 - floor**2, 0.0) * np.square(weight)).sum())

    old, new = excess(before), excess(after)
    return float(np.clip(1 - new / max(old, 1e-300), 0.0, 1.0))


def absorbed(before: Stair, after: Stair) -> tuple[Absorbed, ...]:
    """Determined parameters that moved by more than the standard errors of both, the largest change first."""
    new, count = after.layout, after.layout.effect_start
    values, errors, determined = [], [], np.ones(count, bool)
    for stair in (before, after):
        value, error = stair.x[:count].copy(), stair.covariance.standard_errors[:count].copy()
        error[new.compliance] /= value[new.compliance] ** 2
        value[new.compliance] = 1 / value[new.compliance]
        values.append(value)
        errors.append(error)
        determined &= stair.covariance.prior_share[:count] < 0.5
    a, b = values
    with np.errstate(divide="ignore", invalid="ignore"):
        deviations = np.nan_to_num(np.abs(b - a) / np.hypot(*errors), posinf=0.0) * determined
    out = [
        Absorbed(name, joint, float(a[k]), float(b[k]), unit, float(deviations[k]))
        for k, (name, joint, unit) in enumerate(new.names()[:count])
        if deviations[k] > MOTION.outlier
    ]
    return tuple(sorted(out, key=lambda m: -m.deviations))


def explained_residual(
    effect: ChosenEffect, before: Stair, after: Stair, band: PredictionErrorBand
) -> Evidence:
    """Residual before a step on the effect's joint, or that which changes most, and the part explained."""
    residual = before.errors.residual
    change, joint = residual - after.errors.residual, effect.joint
    if joint is None:
        joint = int(np.argmax(np.mean(change**2, axis=0) / (np.mean(residual**2, axis=0) + 1e-300)))
    ends = np.cumsum([0, *map(len, band.rows.values())])
    order = np.concatenate(list(band.rows.values()))
    return Evidence(
        before.layout.joints[joint],
        tuple((name, int(a), int(b)) for name, a, b in zip(band.rows, ends, ends[1:], strict=False)),
        band.signals.time[order],
        residual[order, joint],
        change[order, joint],
    )


def effect_values(stair: Stair) -> tuple[EffectEntry, ...]:
    """Effects of a model with parameters and standard errors."""
    return tuple(
        EffectEntry(e.effect, own_parameters(e, stair), stair.layout.joint_name(e), e.group, e.payload)
        for e in stair.layout.effects
    )


def steps(stairs: Sequence[Stair], found: Sequence[Finding], last: Verdict) -> list[Step]:
    """The staircase as steps of a result; `last` is the verdict on the model with all effects."""
    to_come = max((k for k, one in enumerate(found, 1) if not one.stopgap), default=0)
    return [
        made_step(one, stair, "missing" if k < to_come else last)
        for k, (one, stair) in enumerate(zip((None, *found), stairs, strict=True))
    ]


def made_step(added: Finding | None, stair: Stair, verdict: Verdict) -> Step:
    """One step of a result: the model after adding an effect."""
    errors, model = stair.errors, stair.layout.model(stair.x)
    return Step(
        added, errors.rms, errors.rms_validation, errors.groups, errors.noise_floor, model,
        verdict=verdict, units=errors.units,
    )  # fmt: skip
