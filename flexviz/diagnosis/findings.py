"""What was found, effect by effect: the staircase of models, and the evidence of each step."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.coarse import Coarse, CoarseModel
from flexviz.diagnosis.criterion import Gain, confidence
from flexviz.diagnosis.elimination import by_weight
from flexviz.diagnosis.fit_context import Fitted
from flexviz.diagnosis.prediction_errors import PredictionErrorBand, PredictionErrors
from flexviz.diagnosis.result import Absorbed, EffectParameter, Evidence, Family, Finding, Step, Tie
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.diagnosis.ties import ties
from flexviz.diagnosis.unknown_curve import is_curve
from flexviz.effects import EFFECT_FAMILIES, EFFECTS, ChosenEffect, family_of
from flexviz.equation import Layout
from flexviz.estimation import Covariance
from flexviz.parallel import shared
from flexviz.results import Verdict

Array = NDArray[np.float64]

LIMITS = THRESHOLDS.criterion
STAIR_ITERATIONS = 10  # of the models of the staircase


@dataclass(frozen=True, eq=False)
class Stair:
    """One model of the staircase.

    Attributes:
        added: the effect that it has more than the one before; None for the first.
        layout, x: the model and its parameters, shape (P,).
        covariance: of them.
        errors: its residuals.
    """

    added: ChosenEffect | None
    layout: Layout
    x: Array
    covariance: Covariance
    errors: PredictionErrors


def staircase(view: Coarse, model: CoarseModel, last: Stair, band: PredictionErrorBand) -> list[Stair]:
    """The set's own model, then one effect more at a time, the weightiest first.

    Args:
        view: fits the models on the way.
        model: the final one at the coarse resolution.
        last: the final one.
        band: in which errors are stated.
    """
    own, fit = view.own, model.fit
    added = [e for e in last.layout.effects if e not in own.effects]
    laws = [e for e in added if not is_curve(e)]
    order = by_weight(view.linearised(model), laws, view.context.spread)
    order += [(curve, fit.x) for curve in added if is_curve(curve)]
    effects = [None, *(effect for effect, _ in order)]

    def stair(count: int) -> Stair:
        layout = Layout(own.joints, (*own.effects, *(e for e, _ in order[:count])))
        start = fit.towards(order[count][1], layout)
        found = view.context.fit(layout, start, iterations=STAIR_ITERATIONS)
        errors = band.errors(found, view.context.first_phase)
        return Stair(effects[count], layout, found.x, found.covariance, errors)

    stairs = list(shared(stair, range(len(order))[::-1]))[::-1]  # the largest, which take longest, first
    return [*stairs, Stair(effects[-1], last.layout, last.x, last.covariance, last.errors)]


def findings(
    view: Coarse,
    model: CoarseModel,
    gains: Mapping[ChosenEffect, Gain],
    stairs: Sequence[Stair],
    band: PredictionErrorBand,
    rivals: Mapping[ChosenEffect, Sequence[str]],
    doubtful: NDArray[np.bool_],
) -> list[Finding]:
    """One finding per added effect, in the order of the staircase.

    Args:
        view, model: the final model at the coarse resolution.
        gains: what each of its effects gains, at the resolution that decided.
        stairs: the staircase.
        band: in which errors are stated.
        rivals: effects → laws that fit as well.
        doubtful: shape (n,), joints with a model error that an effect may imitate.
    """
    last, found = stairs[-1], []
    for before, after in pairwise(stairs):
        effect = after.added
        assert effect is not None
        need = gains[effect] if effect in gains else Gain(0.0, 1.0, np.zeros(view.own.n), np.ones(view.own.n))
        unsure = bool(doubtful.any() if effect.joint is None else doubtful[effect.joint])
        tied = tuple(ties(view, model, effect, rivals.get(effect, ())))
        sure = 0.0 if is_curve(effect) else confidence(need, unsure)
        family = family_in(effect.effect, tied, sure)
        found.append(
            Finding(
                effect.effect,
                last.layout.joint_name(effect),
                effect.group,
                effect.payload,
                score=removed_share(before.errors, after.errors),
                confidence=sure / len(family.members) if family is not None and family.tied else sure,
                parameters=own_parameters(effect, last, last.covariance.standard_errors),
                inseparable_from=tied,
                gain=float(need.delta),
                absorbed=absorbed(before, after),
                evidence=explained_residual(before.layout, effect.joint, band, before.errors, after.errors),
                features=(float(need.delta), float(need.error), float(unsure)),
                family=family,
            )
        )
    return found


def family_in(effect: str, tied: Sequence[Tie], sure: float) -> Family | None:
    """The family of an effect, if it has one: its members that tie in these data, or all of them."""
    name = family_of(effect)
    if name is None:
        return None
    rivals = {tie.effect for tie in tied}
    same = tuple(member for member in EFFECT_FAMILIES[name] if member in rivals or member == effect)
    return Family(name, len(same) > 1, same if len(same) > 1 else EFFECT_FAMILIES[name], sure)


def curve_finding(before: Stair, after: Stair, band: PredictionErrorBand) -> Finding:
    """A free curve that a stair adds: that it is the physics behind the residual has no probability."""
    curve = after.added
    assert curve is not None
    return Finding(
        curve.effect,
        after.layout.joint_name(curve),
        None,
        None,
        score=removed_share(before.errors, after.errors),
        confidence=0.0,
        parameters=own_parameters(curve, after, after.covariance.standard_errors),
        inseparable_from=(),
        gain=0.0,
        evidence=explained_residual(before.layout, curve.joint, band, before.errors, after.errors),
    )


def own_parameters(effect: ChosenEffect, fit: Fitted, std: Array) -> dict[str, EffectParameter]:
    """An effect's parameters in a model; std, of all its parameters, has shape (P,)."""
    where = fit.layout.effect_slice(effect)
    rows = zip(EFFECTS[effect.effect].parameters, fit.x[where], std[where], strict=True)
    return {p.name: EffectParameter(float(v), float(e), p.unit) for p, v, e in rows}


def removed_share(before: PredictionErrors, after: PredictionErrors) -> float:
    """Share of the held-out excess over the noise that a step removed, each joint relative to its noise."""
    floor = np.maximum(np.array(before.noise_floor), 1e-300)

    def excess(errors: PredictionErrors) -> float:
        rms = np.array(errors.rms_validation or errors.rms)
        return float(np.maximum((rms / floor) ** 2 - 1, 0).sum())

    old, new = excess(before), excess(after)
    return float(np.clip(1 - new / max(old, 1e-300), 0.0, 1.0))


def absorbed(before: Stair, after: Stair) -> tuple[Absorbed, ...]:
    """Determined parameters that moved by more than the standard errors of both, the largest change first."""
    new, count = after.layout, after.layout.effect_start
    stiff = new.compliance
    values, errors = [], []
    for stair in (before, after):
        value, error = stair.x[:count].copy(), stair.covariance.standard_errors[:count].copy()
        error[stiff] /= value[stiff] ** 2
        value[stiff] = 1 / value[stiff]
        values.append(value)
        errors.append(error)
    a, b = values
    determined = np.maximum(before.covariance.prior_share, 0)[:count] < 0.5
    determined &= after.covariance.prior_share[:count] < 0.5
    error = np.hypot(*errors)
    with np.errstate(divide="ignore", invalid="ignore"):
        deviations = np.nan_to_num(np.abs(b - a) / error, posinf=0.0) * determined
    out = [
        Absorbed(name, joint, float(a[k]), float(b[k]), unit, float(deviations[k]))
        for k, (name, joint, unit) in enumerate(new.names()[:count])
        if deviations[k] > LIMITS.outlier
    ]
    return tuple(sorted(out, key=lambda m: -m.deviations))


def explained_residual(
    layout: Layout,
    joint: int | None,
    band: PredictionErrorBand,
    before: PredictionErrors,
    after: PredictionErrors,
) -> Evidence:
    """Residual before a step on the effect's joint, and the part that the effect explains.

    Without a joint: on the one that changes most.
    """
    change = before.residual - after.residual
    if joint is None:
        size = np.sqrt(np.mean(before.residual**2, axis=0)) + 1e-300
        joint = int(np.argmax(np.mean(change**2, axis=0) / size**2))
    ends = np.cumsum([0, *map(len, band.rows.values())])
    order = np.concatenate(list(band.rows.values()))
    return Evidence(
        layout.joints[joint],
        tuple((name, int(a), int(b)) for name, a, b in zip(band.rows, ends, ends[1:], strict=False)),
        band.signals.time[order],
        before.residual[order, joint],
        change[order, joint],
    )


def effect_values(fit: Fitted, std: Array) -> tuple[dict[str, object], ...]:
    """Effects of a model with parameters and standard errors; std has shape (P,)."""
    return tuple(
        {
            "effect": effect.effect,
            "joint": fit.layout.joint_name(effect),
            "group": effect.group,
            "payload": effect.payload,
            "parameters": {n: v._asdict() for n, v in own_parameters(effect, fit, std).items()},
        }
        for effect in fit.layout.effects
    )


def steps(stairs: Sequence[Stair], found: Iterable[Finding], last: Verdict) -> Iterator[Step]:
    """The staircase as steps of a result; `last` is the verdict on the model with all effects."""
    added = [None, *found]
    left = sum(one is not None and not one.stopgap for one in added)  # effects that are still to come
    for one, stair in zip(added, stairs, strict=True):
        left -= one is not None and not one.stopgap
        yield made_step(one, stair, stair.errors, "missing" if left > 0 else last)


def made_step(added: Finding | None, fit: Fitted, errors: PredictionErrors, verdict: Verdict) -> Step:
    """One step of a result: the model after adding an effect."""
    model = fit.layout.model(fit.x)
    return Step(added, errors.rms, errors.rms_validation, verdict, errors.groups, errors.noise_floor, model)
