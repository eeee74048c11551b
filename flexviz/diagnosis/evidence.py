"""Evidence for a finding: parameters, ties, absorbing parameters and explained residual."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.acceptance import held_out_share
from flexviz.diagnosis.comparison import CandidateScores, Comparison, RefittedCandidate, SearchStep
from flexviz.diagnosis.confidence import features, probability
from flexviz.diagnosis.fit_context import Fit, FitContext, Fitted
from flexviz.diagnosis.prediction_errors import PredictionErrorBand, PredictionErrors
from flexviz.diagnosis.result import Absorbed, EffectParameter, Evidence, Finding, Step, Tie
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.equation import Layout
from flexviz.estimation import ScoredCandidate
from flexviz.results import Verdict

Array = NDArray[np.float64]


LIMITS = THRESHOLDS.evidence


def explain(context: FitContext, step: SearchStep, final: Fit, shown: Evidence | None = None) -> Finding:
    """Finding that describes a step of the search.

    Args:
        context: the data.
        step: the added effect and the models before and after.
        final: final model of the diagnosis.
        shown: residual that the effect explains; None for candidates that were not added.
    """
    before, effect, fit = step.before, step.chosen.effect, step.chosen.fit
    std = context.covariance(fit).standard_errors
    evidenced = features(before, fit, final)
    return Finding(
        effect.effect,
        fit.layout.joint_name(effect),
        effect.group,
        effect.payload,
        held_out_share(before, fit),
        probability(evidenced),
        own_parameters(effect, fit, std),
        () if step.scores is None else ties(context, step, step.scores),
        float(before.objective - fit.objective),
        absorbed(before, fit, std),
        shown,
        evidenced,
    )


def own_parameters(effect: ChosenEffect, fit: Fitted, std: Array) -> dict[str, EffectParameter]:
    """An effect's parameters in a model; std, of all its parameters, has shape (P,)."""
    where = fit.layout.effect_slice(effect)
    rows = zip(EFFECTS[effect.effect].parameters, fit.x[where], std[where], strict=True)
    return {p.name: EffectParameter(float(v), float(e), p.unit) for p, v, e in rows}


def uncertain(context: FitContext, step: SearchStep, final: Fit) -> bool:
    """Whether an effect found while a law is still missing is too uncertain: it may imitate that law."""
    return explain(context, step, final).confidence < THRESHOLDS.model_error.least_confidence


def made_step(added: Finding | None, fit: Fitted, errors: PredictionErrors, verdict: Verdict) -> Step:
    """One step of a result: the model after adding an effect."""
    model = fit.layout.model(fit.x)
    return Step(added, errors.rms, errors.rms_validation, verdict, errors.groups, errors.noise_floor, model)


def ties(context: FitContext, step: SearchStep, scores: CandidateScores) -> tuple[Tie, ...]:
    """Effects that the data cannot distinguish from the added one."""
    before, best = step.before, step.chosen
    tied_gain = max(LIMITS.tied_gain, LIMITS.tied_share * (before.objective - best.fit.objective))
    mine = _unit_signature(best.scored, scores)
    out = []
    for s in scores.ranked[: THRESHOLDS.search.kept_signatures]:
        if s.effect == best.effect:
            continue
        other = _unit_signature(s, scores)
        correlation = abs(float(other @ mine))
        rival = step.objectives.get(s.effect)
        close = rival is not None and rival - best.fit.objective < tied_gain
        if close or (rival is None and correlation > LIMITS.tied_correlation):
            breaks = telling_motion(context, before, best.effect, mine, other)
            out.append(Tie(s.effect.effect, before.layout.joint_name(s.effect), correlation, breaks))
    return tuple(out)


def _unit_signature(scored: ScoredCandidate, scores: CandidateScores) -> Array:
    rest = scores.projection.rest(scored.signature[:, None], scored.rows)[:, 0]
    return rest / max(float(np.linalg.norm(rest)), 1e-300)


def telling_motion(context: FitContext, fit: Fit, effect: ChosenEffect, mine: Array, other: Array) -> str:
    """Sentence that names the motion or payload in which two unit signatures, shape (N·n,), differ most."""
    difference = mine - float(mine @ other) * other
    squares = difference.reshape(fit.point.r.shape) ** 2
    density = squares.sum(axis=1)
    used = fit.point.used
    if density[used].sum() <= 1e-12:
        return "The two effects look the same in every motion of this set: record a different kind of motion."
    joint = effect.joint if effect.joint is not None else int(np.argmax(squares.sum(axis=0)))
    average = density[used].mean()
    ranked = [
        (float(density[rows & used].mean() / average), text)
        for text, rows in _kinds_of_motion(context, joint, fit.layout.joints[joint]).items()
        if np.count_nonzero(rows & used) > LIMITS.telling_samples * len(used)
    ]
    ratio, text = max(ranked, default=(0.0, ""))
    if ratio < LIMITS.telling_density:
        return "They differ slightly in every motion: any additional data would help."
    return f"They differ most in {text} ({ratio:.1f} times the average): record more data of this kind."


def _kinds_of_motion(context: FitContext, joint: int, name: str) -> dict[str, NDArray[np.bool_]]:
    """Description → samples, shape (N,), of each kind of motion of a joint and of each group."""
    signals = context.two_band.narrow.signals
    position, load = signals.theta[0, :, joint], np.abs(signals.tau[0, :, joint])
    speed, acceleration = np.abs(signals.theta[1:3, :, joint])
    low, high = np.quantile(position, [0.15, 0.85])
    kinds: dict[str, NDArray[np.bool_]] = {
        f"slow motion and reversals of {name}": speed < np.quantile(speed, 0.15),
        f"fast motion of {name}": speed > np.quantile(speed, 0.85),
        f"high torque on {name}": load > np.quantile(load, 0.85),
        f"torque near zero on {name}": load < np.quantile(load, 0.15),
        f"strong acceleration of {name}": acceleration > np.quantile(acceleration, 0.85),
        f"positions of {name} near {low:.2g} rad": position < low,
        f"positions of {name} near {high:.2g} rad": position > high,
    }
    for k, group in enumerate(signals.groups):
        rows = np.zeros(signals.count, bool)
        for block in signals.blocks:
            if block.group == k:
                rows[block.rows] = True
        kinds[f"motion and payload of group {group.name} (payload {group.payload})"] = rows
    return kinds


def absorbed(before: Fitted, after: Fitted, std: Array) -> tuple[Absorbed, ...]:
    """Parameters that changed when the effect was added, the largest change in standard errors first."""
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
        if deviations[k] > LIMITS.absorbed_deviations and abs(b[k] - a[k]) > LIMITS.absorbed_share * abs(b[k])
    ]
    return tuple(sorted(out, key=lambda m: -m.deviations)[: LIMITS.absorbed_parameters])


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
    out = []
    for effect in fit.layout.effects:
        values = own_parameters(effect, fit, std)
        out.append(
            {
                "effect": effect.effect,
                "joint": fit.layout.joint_name(effect),
                "group": effect.group,
                "payload": effect.payload,
                "parameters": {name: one._asdict() for name, one in values.items()},
            }
        )
    return tuple(out)


def ranked(
    context: FitContext, base: Fit, tried: Sequence[RefittedCandidate], first: Sequence[Finding]
) -> list[Finding]:
    """Candidates for the model `base`: the one added, `first`, then the others that were refitted."""
    out = list(first)
    named = {(f.effect, f.joint, f.group, f.payload) for f in out}
    results = Comparison(list(tried)).objectives
    for one in tried:
        effect = one.effect
        key = (effect.effect, base.layout.joint_name(effect), effect.group, effect.payload)
        if key in named or base.objective - one.fit.objective <= 0:
            continue
        other = explain(context, SearchStep(base, one, results), one.fit)
        most = (1 - out[0].confidence if out else 0.5) / (1 + len(out))
        out.append(replace(other, confidence=min(other.confidence, most)))
    return out
