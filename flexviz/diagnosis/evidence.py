"""A refitted candidate in words and numbers: values, rivals, what had absorbed it, what it takes away."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.acceptance import score_of
from flexviz.diagnosis.confidence import features, probability
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.prediction_errors import PredictionErrorBand, PredictionErrors
from flexviz.diagnosis.result import Absorbed, EffectParameter, Evidence, Finding, Tie
from flexviz.diagnosis.search import SIGNATURES, Scores, Tried
from flexviz.diagnosis.telling_apart import breaking
from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.estimation import Covariance, Scored, sandwich

Array = NDArray[np.float64]

TIED = 20.0  # difference of the objective up to which two effects fit equally well
TIED_SHARE = 0.02  # the same as a share of the gain: laws are only nearly right
ALIKE = 0.98  # correlation of signatures from which on a candidate that was not refitted counts as tied
MOVED = 4.0  # standard errors from which on a parameter had absorbed an effect
MOVED_SHARE = 0.01  # and this share of its value
MENTIONED = 6  # parameters


def fit_covariance(context: FitContext, fit: Fit) -> Covariance:
    """Covariance of a fit, from the residual's own spectra."""
    prior, _ = context.prior_and_bounds(fit.layout)
    normal = fit.point.normal_equations(prior)
    return sandwich(normal.information, fit.point.score_covariance(), normal.prior_hessian)


def explain(
    context: FitContext,
    before: Fit,
    best: Tried,
    objectives: Mapping[ChosenEffect, float],
    scores: Scores | None,
    final: Fit,
    errors: tuple[PredictionErrorBand, PredictionErrors, PredictionErrors] | None = None,
) -> Finding:
    """A candidate as a finding.

    Args:
        context: the data.
        before: the model without it.
        best: with it, refitted.
        objectives: of all candidates that were refitted.
        scores: of all candidates at `before`; None for one that is only mentioned.
        final: the last model of the diagnosis.
        errors: the band of errors and the errors before and after; None for one that is only mentioned.
    """
    effect, fit = best.effect, best.fit
    std = fit_covariance(context, fit).standard_errors
    where = dict(fit.layout.effect_slices())[effect]
    specs = EFFECTS[effect.effect].parameters
    tied = () if scores is None else ties(context, before, best, objectives, scores)
    same = {(t.effect, t.joint) for t in tied}
    rivals = [
        objective
        for other, objective in objectives.items()
        if other != effect and (other.effect, before.layout.joint_name(other)) not in same
    ]
    margin = (min(rivals) if rivals else before.objective) - fit.objective
    evidenced = features(before, fit, final, margin)
    return Finding(
        effect.effect,
        fit.layout.joint_name(effect),
        effect.group,
        effect.payload,
        score_of(before, fit),
        probability(evidenced),
        {
            p.name: EffectParameter(float(v), float(e), p.unit)
            for p, v, e in zip(specs, fit.x[where], std[where], strict=True)
        },
        tied,
        float(before.objective - fit.objective),
        absorbed(before, fit, std),
        None if errors is None else evidence(best, *errors),
        evidenced,
    )


def ties(
    context: FitContext, before: Fit, best: Tried, objectives: Mapping[ChosenEffect, float], scores: Scores
) -> tuple[Tie, ...]:
    """What the data cannot tell from the best candidate."""
    gain = before.objective - best.fit.objective
    mine = _unit(best.scored, scores)
    out = []
    for s in scores.ranked[:SIGNATURES]:
        if s.effect == best.effect:
            continue
        other = _unit(s, scores)
        correlation = abs(float(other @ mine))
        rival = objectives.get(s.effect)
        close = rival is not None and rival - best.fit.objective < max(TIED, TIED_SHARE * gain)
        if close or (rival is None and correlation > ALIKE):
            out.append(
                Tie(
                    s.effect.effect,
                    before.layout.joint_name(s.effect),
                    correlation,
                    breaking(context, before, best.effect, mine, other),
                )
            )
    return tuple(out)


def _unit(scored: Scored, scores: Scores) -> Array:
    rest = scores.projection.rest(scored.signature[:, None], scored.rows)[:, 0]
    return rest / max(float(np.linalg.norm(rest)), 1e-300)


def absorbed(before: Fit, after: Fit, std: Array) -> tuple[Absorbed, ...]:
    """Parameters that moved when the effect was added, by the largest number of standard errors first."""
    old, new = before.layout, after.layout
    count = new.effect_start
    a, b = before.x[:count].copy(), after.x[:count].copy()
    error = std[:count].copy()
    stiff = new.compliance
    error[stiff] = error[stiff] / b[stiff] ** 2
    a[stiff], b[stiff] = 1 / a[stiff], 1 / b[stiff]
    assert old.joints == new.joints
    with np.errstate(divide="ignore", invalid="ignore"):
        deviations = np.nan_to_num(np.abs(b - a) / error, posinf=0.0)
    out = [
        Absorbed(name, joint, float(a[k]), float(b[k]), unit, float(deviations[k]))
        for k, (name, joint, unit) in enumerate(new.names()[:count])
        if deviations[k] > MOVED and abs(b[k] - a[k]) > MOVED_SHARE * abs(b[k])
    ]
    return tuple(sorted(out, key=lambda m: -m.deviations)[:MENTIONED])


def evidence(
    best: Tried, band: PredictionErrorBand, before: PredictionErrors, after: PredictionErrors
) -> Evidence:
    """The residual of the joint that the effect changes most, before it and what it takes away."""
    change = before.residual - after.residual
    joint = best.effect.joint
    if joint is None:
        size = np.sqrt(np.mean(before.residual**2, axis=0)) + 1e-300
        joint = int(np.argmax(np.mean(change**2, axis=0) / size**2))
    groups, rows, at = [], [], 0
    for name, here in band.rows.items():
        groups.append((name, at, at + len(here)))
        rows.append(here)
        at += len(here)
    order = np.concatenate(rows)
    return Evidence(
        best.fit.layout.joints[joint],
        tuple(groups),
        band.signals.time[order],
        before.residual[order, joint],
        change[order, joint],
    )
