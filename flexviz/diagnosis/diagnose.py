"""Find what is missing: score, refit, decide, add, look again."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from flexviz.diagnosis.candidates import candidates, with_effect
from flexviz.diagnosis.contact import contacts
from flexviz.diagnosis.fitting import Fit, Workbench
from flexviz.diagnosis.result import Diagnosis, Finding, Step, Tie
from flexviz.diagnosis.where import places
from flexviz.effects import EFFECTS, choose_effects
from flexviz.equation import Equation, Layout, build_signals
from flexviz.identification import identify
from flexviz.identification.identify import carried
from flexviz.identification.scoring import Scored, best_each, score
from flexviz.identification.summary import parameter_estimates
from flexviz.identification.uncertainty import colour_matrix, covariance
from flexviz.measurements import Group, MeasurementSet
from flexviz.observers import FlatZeroPhase

Array = NDArray[np.float64]

GAIN_FIRST, GAIN_LATER = 60.0, 120.0  # fall of the objective that an effect has to bring
WORTH = 0.1  # of the excess, or it is not worth a name
CLEAN_FIRST, CLEAN_LATER = 0.3, 1.0  # χ² per sample above the noise up to which nothing is looked for
STRUCTURED = 6.0  # above this what is left is not noise
ROUNDS = 5
ERROR_HERTZ = 5.0  # band of the errors that are shown
TRIED, SECOND, LAST = 6, 3, 2  # refitted for a few steps, for more, to the end


class Interrupted(Exception):
    """Raised between steps when the user stops the diagnosis."""


@dataclass(frozen=True)
class Progress:
    """How far a diagnosis is: a sentence and a share, 0 … 1."""

    text: str
    share: float


@dataclass(frozen=True)
class _Tried:
    scored: Scored
    fit: Fit


def diagnose(
    measurements: MeasurementSet,
    *,
    apply: bool = True,
    progress: Callable[[Progress], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> Diagnosis:
    """Say whether the set's model is complete, and if not, what is missing.

    Args:
        measurements: the set.
        apply: add the found effects one by one and refit after each.
        progress: called between fits.
        should_stop: asked between steps; what was found so far is returned.
    """
    with threadpool_limits(1, "blas"):
        return _Search(measurements, progress, should_stop).run(apply)


class _Search:
    def __init__(
        self,
        measurements: MeasurementSet,
        progress: Callable[[Progress], None] | None,
        should_stop: Callable[[], bool] | None,
    ) -> None:
        self.measurements, self.progress, self.should_stop = measurements, progress, should_stop
        wanted = choose_effects(measurements.effects, measurements.joints, carried(measurements))
        self.layout = Layout(measurements.joints, wanted)
        self.bench = Workbench(measurements, self.layout)
        self.stopped = False

    def say(self, text: str, share: float) -> None:
        if self.progress is not None:
            self.progress(Progress(text, share))
        self.check()

    def check(self) -> None:
        if self.should_stop is not None and self.should_stop():
            self.stopped = True
            raise Interrupted

    # -- the search -------------------------------------------------------------------------------------

    def run(self, apply: bool) -> Diagnosis:
        began = time.perf_counter()
        first = identify(self.measurements, should_stop=self.should_stop)
        base = self.bench.fit(self.layout, self.layout.vector(first.model), iterations=12)
        fit = base
        chain: list[tuple[Finding | None, Fit]] = [(None, base)]
        ranked: list[_Tried] = []
        try:
            for number in range(ROUNDS):
                if excess(fit) < (CLEAN_FIRST if number == 0 else CLEAN_LATER):
                    break
                self.say("looking at what is left", number / ROUNDS)
                scored = self.scores(fit)
                tried = self.refits(fit, scored, number)
                if number == 0:
                    ranked = tried
                best = self.acceptable(fit, tried, number)
                if best is None:
                    break
                alone = self.simpler(base, chain, best)
                if alone is not None:
                    best, fit = alone, base
                    del chain[1:]
                finding = self.finding(fit, best, tried, scored)
                fit = best.fit
                chain.append((finding, fit))
                if not apply:
                    break
        except Interrupted:
            pass
        return self.answer(base, fit, chain, ranked, time.perf_counter() - began)

    def scores(self, fit: Fit) -> list[Scored]:
        """Every candidate's score at a fit, best first."""
        layout, point = fit.layout, fit.point
        refinement = self.bench.refinement.with_layout(layout)
        refinement.narrow.prepare(fit.x)
        prior, _ = self.bench.assumptions(layout)
        flat = point.z.reshape(-1, layout.size)
        hessian = flat.T @ flat + prior.gradient_and_hessian(fit.x)[1]

        def weigh(columns: Array) -> Array:
            parts = [m.apply(columns[b.rows]) for m, b in zip(point.metrics, refinement.blocks, strict=True)]
            out = np.concatenate(parts)
            out[~point.used] = 0.0
            return out.reshape(-1, columns.shape[2])

        residual = point.r.ravel()
        wanted = candidates(layout, self.bench.fit_groups)
        chain = self.bench.chain(fit)
        scored = score(refinement.narrow, chain, wanted, weigh, residual, flat, hessian)
        scored += contacts(refinement.narrow, weigh, residual, flat, hessian)
        return best_each(scored)

    def refits(self, fit: Fit, scored: list[Scored], number: int) -> list[_Tried]:
        """The leading candidates refitted, by halving; best first."""
        tried: list[_Tried] = []
        for s in scored[:TRIED]:
            self.say(f"trying {EFFECTS[s.effect.effect].title.lower()}", (number + 0.3) / ROUNDS)
            layout, x = with_effect(fit.layout, fit.x, s.effect, s.values)
            x = self.bench.roughly(layout, x, self.check)
            tried.append(_Tried(s, self.bench.fit(layout, x, iterations=3, check=self.check)))
        leading = tried[:1]  # the best score is followed to the end, however it begins
        for keep, more in ((SECOND, 4), (LAST, 12)):
            tried.sort(key=lambda t: t.fit.objective)
            chosen = tried[:keep] + [t for t in leading if t not in tried[:keep]]
            done = [
                t
                if t.fit.converged
                else replace(t, fit=self.bench.fit(t.fit.layout, t.fit.x, iterations=more))
                for t in chosen
            ]
            leading = [d for d, t in zip(done, chosen, strict=True) if any(t is old for old in leading)]
            tried = done + [t for t in tried if t not in chosen]
        return sorted(tried, key=lambda t: t.fit.objective)

    def simpler(self, base: Fit, chain: list[tuple[Finding | None, Fit]], best: _Tried) -> _Tried | None:
        """The newest effect alone, where what was added before it has become superfluous."""
        if len(chain) < 2:
            return None
        law = best.scored
        layout, x = with_effect(base.layout, best.fit.x[: base.layout.size], law.effect, law.values)
        here = dict(best.fit.layout.effect_slices())[law.effect]
        x[layout.effect_slices()[-1][1]] = best.fit.x[here]
        alone = self.bench.fit(layout, x, iterations=12, check=self.check)
        return replace(best, fit=alone) if alone.objective < best.fit.objective + GAIN_FIRST else None

    def acceptable(self, fit: Fit, tried: list[_Tried], number: int) -> _Tried | None:
        """The best refitted candidate, if it is worth adding."""
        possible = [t for t in tried if not at_bound(t)]
        if not possible:
            return None
        best = possible[0]
        gain = fit.objective - best.fit.objective
        if gain < (GAIN_FIRST if number == 0 else GAIN_LATER):
            return None
        removed = 1 - excess(best.fit) / max(excess(fit), 1e-9)
        return best if removed > WORTH else None

    # -- the answer -------------------------------------------------------------------------------------

    def finding(self, fit: Fit, best: _Tried, tried: list[_Tried], scored: list[Scored]) -> Finding:
        """A refitted candidate in words and numbers."""
        effect = best.scored.effect
        where = dict(best.fit.layout.effect_slices())[effect]
        std = self.standard_errors(best.fit)[where]
        specs = EFFECTS[effect.effect].parameters
        gain = fit.objective - best.fit.objective
        # how much better than the best rival, in units in which simulated cases show the right one to win
        rivals = [t.fit.objective for t in tried if t.scored.effect != effect]
        margin = (min(rivals) if rivals else fit.objective) - best.fit.objective
        relative = margin / max(gain, 1.0)
        evidence = min(margin / 30.0, 4.0) + 4.0 * (relative - 0.1)
        confidence = float(1 / (1 + np.exp(-np.clip(evidence, -30.0, 30.0))))
        ties = []
        for s in scored[:12]:
            if s.effect == effect:
                continue
            correlation = abs(float(s.signature @ best.scored.signature))
            rival = next((t for t in tried if t.scored.effect == s.effect), None)
            close = rival is not None and rival.fit.objective - best.fit.objective < 0.05 * max(gain, 1.0)
            if close or (correlation > 0.95 and rival is None):
                ties.append(Tie(s.effect.effect, best.fit.layout.joint_name(s.effect), correlation))
        return Finding(
            effect.effect,
            best.fit.layout.joint_name(effect),
            effect.group,
            effect.payload,
            score_of(fit, best.fit),
            confidence,
            {
                p.name: (float(v), float(e), p.unit)
                for p, v, e in zip(specs, best.fit.x[where], std, strict=True)
            },
            tuple(ties),
            float(gain),
        )

    def standard_errors(self, fit: Fit) -> Array:
        return np.sqrt(np.maximum(np.diag(self.covariance(fit)[0]), 0.0))

    def covariance(self, fit: Fit) -> tuple[Array, Array]:
        prior, _ = self.bench.assumptions(fit.layout)
        flat = fit.point.z.reshape(-1, fit.layout.size)
        rows = [b.rows for b in self.bench.refinement.blocks]
        colour = colour_matrix(fit.point.r, fit.point.z, rows)
        return covariance(flat.T @ flat, colour, prior.gradient_and_hessian(fit.x)[1])

    def errors(self, fit: Fit, groups: list[Group]) -> tuple[float, ...] | None:
        """Residual rms per joint in a band that is flat where the robot moves [Nm]."""
        if not groups:
            return None
        signals = build_signals(self.measurements, groups, FlatZeroPhase(2 * np.pi * ERROR_HERTZ))
        equation = Equation(self.measurements.robot, signals, fit.layout)
        equation.prepare(fit.x)
        residual = equation.evaluate(fit.x).residual
        return tuple(map(float, np.sqrt(np.mean(residual**2, axis=0))))

    def answer(
        self,
        base: Fit,
        final: Fit,
        chain: list[tuple[Finding | None, Fit]],
        ranked: list[_Tried],
        seconds: float,
    ) -> Diagnosis:
        findings = []
        if len(chain) > 1 and chain[1][0] is not None:
            findings.append(chain[1][0])
        for t in ranked:
            if findings and t.scored.effect.effect == findings[0].effect:
                same_joint = base.layout.joint_name(t.scored.effect) == findings[0].joint
                if same_joint and t.scored.effect.payload == findings[0].payload:
                    continue
            if base.objective - t.fit.objective > 0:
                other = self.finding(base, t, ranked, [])
                findings.append(replace(other, confidence=min(other.confidence, 0.5 / (1 + len(findings)))))
        steps = []
        for index, (added, fit) in enumerate(chain):
            verdict = "missing" if index + 1 < len(chain) else self.verdict(fit)
            held_out = self.errors(fit, self.bench.held_out_groups)
            rms = self.errors(fit, self.bench.fit_groups)
            assert rms is not None
            steps.append(Step(added, rms, held_out, verdict))
        cov, share = self.covariance(final)
        prior, _ = self.bench.assumptions(final.layout)
        estimates = parameter_estimates(
            final.layout, final.x, prior.centre, cov, share, np.zeros(final.layout.size, bool), prior
        )
        model = final.layout.model(final.x)
        effects = tuple(
            {
                "effect": e.effect,
                "joint": e.joint,
                "group": e.group,
                "payload": e.payload,
                "parameters": {
                    p.name: {"value": e.parameters[p.name], "std": None, "unit": p.unit}
                    for p in EFFECTS[e.effect].parameters
                },
            }
            for e in model.effects
        )
        return Diagnosis(
            self.measurements.name,
            steps[0].verdict,
            tuple(findings),
            places(self.bench, final),
            tuple(steps),
            effects,
            estimates,
            seconds,
            self.stopped,
        )

    def verdict(self, fit: Fit) -> str:
        """On a model to which nothing worth a name could be added."""
        return "unknown" if excess(fit) > STRUCTURED else "nothing-missing"


def at_bound(tried: _Tried) -> bool:
    """Whether a parameter ended at a bound: a gain of −80 % is a search that ran away, not a finding."""
    effect = tried.scored.effect
    values = tried.fit.x[dict(tried.fit.layout.effect_slices())[effect]]
    specs = EFFECTS[effect.effect].parameters
    edges = [(v, edge) for v, p in zip(values, specs, strict=True) for edge in (p.lower, p.upper) if edge]
    return any(np.isfinite(edge) and abs(v - edge) <= 1e-6 * abs(edge) for v, edge in edges)


def excess(fit: Fit) -> float:
    """Mean χ² per sample above the noise, over joints, fit and validation groups."""
    values = np.concatenate((fit.chi, fit.chi_held_out[np.isfinite(fit.chi_held_out)]))
    return float(np.mean(np.maximum(values - 1.0, 0.0)))


def score_of(before: Fit, after: Fit) -> float:
    """Share of the excess held-out variance that a refit removed; the fit groups' without any."""
    held_out = np.isfinite(before.chi_held_out).all()
    old = before.chi_held_out if held_out else before.chi
    new = after.chi_held_out if held_out else after.chi
    gone = 1 - np.maximum(new - 1, 0).sum() / max(float(np.maximum(old - 1, 0).sum()), 1e-9)
    return float(np.clip(gone, 0.0, 1.0))
