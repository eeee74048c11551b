"""Diagnosis of a set that hides many effects at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from flexviz.diagnosis import stages
from flexviz.diagnosis.bandwidth_check import check_bandwidth
from flexviz.diagnosis.confidence import probability_among_many
from flexviz.diagnosis.evidence import effect_values
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.free_curve import fit_free_curve
from flexviz.diagnosis.model_family import PlainModel, RichModel, without_curves
from flexviz.diagnosis.motion_fit import MotionContext, MotionFit
from flexviz.diagnosis.motion_samples import Phase, Phases
from flexviz.diagnosis.notes import notes
from flexviz.diagnosis.prediction_errors import PredictionErrorBand, PredictionErrors
from flexviz.diagnosis.records import BandwidthCheck, FreeCurve, ResidualMap
from flexviz.diagnosis.residual_location import Located, locate_residual
from flexviz.diagnosis.result import Diagnosis, ResidualLocation
from flexviz.diagnosis.rich_result import (
    features,
    findings,
    leaves_only_noise,
    staircase,
    steps,
    verdict_on,
    with_curves,
)
from flexviz.diagnosis.rich_search import RichSearch
from flexviz.diagnosis.so_far import Standing
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.effects import ChosenEffect, free_curve
from flexviz.equation import Layout
from flexviz.identification import parameter_estimates
from flexviz.measurements import MeasurementSet
from flexviz.parallel import stopped_by
from flexviz.progress import never
from flexviz.results import Note, Verdict
from flexviz.wording import listed

LIMITS = THRESHOLDS.motion
LISTED_CANDIDATES = 8


@dataclass(frozen=True, eq=False)
class InspectedModel:
    """What a model of the staircase leaves.

    Attributes:
        fit: of the model.
        curves: free curves beside which it was fitted.
        model: as shown: with them or without.
        at_noise: the shown model evaluated in units of the noise.
        where: where the residual without the curves lies.
        maps: of the shown model's residual.
        free_curve: of that residual; None unless "unknown", or if nothing is left beside `curves`.
    """

    fit: MotionFit
    curves: Sequence[ChosenEffect]
    model: PlainModel
    at_noise: Fit
    where: tuple[ResidualLocation, ...]
    maps: tuple[ResidualMap, ...]
    free_curve: FreeCurve | None


class ManyEffects:
    """The search backwards on a set, and its result.

    Args:
        measurements: the set.
        layout: the set's own model.
        band: band in which residuals are shown.
        say: called with a progress message; may raise to stop.
        standing: is told of the models found.
    """

    def __init__(
        self,
        measurements: MeasurementSet,
        layout: Layout,
        band: PredictionErrorBand,
        say: Callable[[str], None],
        standing: Standing,
    ) -> None:
        self.measurements, self.layout, self.band, self.say = measurements, layout, band, say
        self.context = MotionContext(measurements, layout.joints, stand_ins=True)
        self.search = RichSearch(self.context, layout, say, standing)

    def find(self) -> RichModel | None:
        """The smallest model found.

        None if the set hides only a few effects: adding them one at a time is then more reliable. A set with
        one unknown law also counts as one of many if its free curve leaves hardly any residual.
        """
        survey = self.search.survey()
        if not self.search.hides_many(survey):
            return None
        return self.useful(self.search.run(survey))

    def useful(self, rich: RichModel) -> RichModel | None:
        """The model, if the set hides many effects, or if two that are found together explain everything."""
        added, noise = rich.added(self.layout), self.context.noise_floor
        if len(added) >= LIMITS.many or (leaves_only_noise(rich) and len(added) > 1):
            return rich
        unknown = {curve.joint for curve in rich.curves}
        if not unknown or not all(effect.joint in unknown for effect in added):
            return None
        # what little else is on those joints mends the form of their curves
        alone = self.search.with_curves_only(rich) if added else rich
        spread = self.context.spread
        little = np.maximum(LIMITS.little * spread, LIMITS.little_left * self.search.bare.rms)
        return alone if np.all(alone.fit.rms < np.maximum(LIMITS.near_noise * noise, little)) else None

    def worth_showing(self, rich: RichModel) -> RichModel | None:
        """The model of a search that was stopped, if it has many effects; nothing is fitted any more."""
        return rich if len(rich.added(self.layout)) >= LIMITS.many else None

    def result(
        self, rich: RichModel, apply: bool, curves: bool, guarded: bool, tell: Callable[[str], None]
    ) -> Diagnosis:
        """The staircase of a model as a diagnosis; without `apply`, of the set's own model.

        Where something is left is said of the model without its free curves: they explain nothing.

        Args:
            rich: the model.
            apply: whether the result describes this model. Not if an unknown law remains and no effect is
                certain: the effects then probably imitate it.
            curves: whether it ends with the model's free curves.
            guarded: whether to check it against the observer's bandwidth.
            tell: called with a progress message. It does not stop the work: what is found is not thrown away.
        """
        tell(stages.STAIRS)
        last: Verdict = verdict_on(rich)
        imitations = last == "unknown" and doubtful(rich, rich.added(self.layout))
        apply = apply and not imitations

        def own_work() -> InspectedModel | None:
            return self.inspected(rich.fit, rich.curves, curves, last) if apply else None

        with stopped_by(never):
            seen, stairs = staircase(self.context, self.layout, rich, self.band, own_work)
        found = list(findings(stairs, rich, self.band))
        if found and not apply and not imitations:
            last = "missing"
        added = found
        if not apply:
            stairs, added = stairs[:1], []
        elif curves:
            stairs, added = with_curves(stairs, found, rich, self.band)
        taken = steps(stairs, added, last)
        if seen is None:
            tell(stages.LOCATION)
            own = self.context.fit(stairs[0].layout, stairs[0].x, iterations=0)
            seen = self.inspected(own, (), False, last)
        final, model = seen.fit, seen.model
        bandwidths = self.checked(model, tell) if guarded else None
        prior, covariance = self.context.start(model.layout).prior, model.covariance(final)
        return Diagnosis(
            set_name=self.measurements.name,
            verdict=taken[0].verdict,
            findings=tuple(found[:LISTED_CANDIDATES]),
            where=seen.where,
            steps=tuple(taken),
            effects=effect_values(model, covariance.standard_errors),
            parameters=parameter_estimates(
                model.layout, model.x, prior.centre, covariance, final.at_bound[model.kept], prior
            ),
            seconds=0.0,
            notes=(*self.remarks(final, seen.curves, last), *said(seen, last, stairs[-1].errors, bandwidths)),
            model=model.layout.model(model.x),
            maps=seen.maps,
            free_curve=seen.free_curve,
            guard=bandwidths,
            torque_spread=self.measurements.torque_spread,
        )

    def checked(self, model: PlainModel, tell: Callable[[str], None]) -> BandwidthCheck:
        """A model's parameters against the observer's bandwidth."""
        tell(stages.BANDWIDTH)
        return check_bandwidth(self.measurements, model.layout, model.x)

    def inspected(
        self, fit: MotionFit, curves: Sequence[ChosenEffect], kept: bool, last: Verdict
    ) -> InspectedModel:
        """What a model leaves, whose free curves are `kept` or not; if "unknown", a curve of the rest."""
        plain = without_curves(fit, curves)
        model = without_curves(fit, ()) if kept else plain
        context, at_noise, located = self.located(model)
        where, curve = located.places, None
        if last == "unknown":
            curve = fit_free_curve(context, at_noise, located.places[0], located.parts)
        if kept and curves:
            where = self.located(plain)[2].places
            curve = curve if curve is not None and curve.certain else None
        return InspectedModel(fit, curves, model, at_noise, where, located.maps, curve)

    def located(self, model: PlainModel) -> tuple[FitContext, Fit, Located]:
        """A model in units of the noise, and where its residual lies."""
        context = FitContext(self.measurements, model.layout)
        at_noise = context.fit(model.layout, model.x, iterations=0)
        return context, at_noise, locate_residual(context, at_noise)

    def remarks(self, final: MotionFit, curves: Sequence[ChosenEffect], last: Verdict) -> list[Note]:
        """What the final model explains, and what was judged apart."""
        joints = self.layout.joints
        share = 1 - (final.held_out_rms() / self.context.spread) ** 2
        which = "held-out" if final.held_out else "fitted"
        values = ", ".join(f"{j} {100 * max(v, 0.0):.3g} %" for j, v in zip(joints, share, strict=True))
        out = [Note("explained", f"share of the {which} torque that the model explains: {values}")]
        if self.context.first_phase.any():
            out.append(Note("standstill", standstill_text(joints, self.context.first_phase)))
        ratio = final.rms / self.context.noise_floor
        complete = last == "nothing-missing" and not curves
        if complete and LIMITS.small_left < ratio.max() < LIMITS.unexplained:
            text = (
                f"the residual of {joints[int(ratio.argmax())]} is {ratio.max():.2g} times its noise: no "
                "candidate explains it, but small effects may remain"
            )
            out.append(Note("other", text))
        for curve in curves:
            law = free_curve(curve.effect)
            assert law is not None
            joint = joints[curve.place.own_joint]
            text = (
                f"{joint} follows a law that is not in the library: a free curve of {law.variable} stood in "
                "for it while the other effects were judged"
            )
            out.append(Note("other", text))
        return out


def said(
    seen: InspectedModel, last: Verdict, errors: PredictionErrors, bandwidths: BandwidthCheck | None
) -> tuple[Note, ...]:
    """The notes that a verdict of either search has, here on a model of the search backwards."""
    unexplained = seen.fit.sigma**2 if last == "unknown" else None
    return notes(seen.at_noise, last, errors, unexplained, seen.free_curve, bandwidths)


def standstill_text(joints: Sequence[str], first_phase: Phases) -> str:
    """Which samples do not count; `first_phase`, shape (n,): the first phase of each joint that does."""
    names = listed([j for j, first in zip(joints, first_phase, strict=True) if first])
    starts = [j for j, first in zip(joints, first_phase, strict=True) if first == Phase.MOTION]
    also = f", of {listed(starts)} also the first {LIMITS.start_angle:g} rad after it" if starts else ""
    return (
        f"samples at standstill of {names} are excluded{also}, here and from the errors: static friction can "
        "take any value up to its limit, so the model is much less accurate there"
    )


def doubtful(rich: RichModel, added: Sequence[ChosenEffect]) -> bool:
    """Whether the model has added effects, and none of them is certain."""
    confidences = [probability_among_many(features(rich, e, rich.needed[e])) for e in added]
    return bool(confidences) and max(confidences) < LIMITS.doubtful
