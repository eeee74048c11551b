"""The one estimator: the parameters of a model, the same for whoever asks.

Where the sensors' noise explains what the model leaves, or the rest is below a stated tolerance, all of the
band counts and the observer's bias is removed (`refine`). Where the model errs by more, weights from the
sensors' noise mislead: then the band of the motion counts, each joint weighted by what the model leaves
(`flexviz.analysis.motion`). Standstill is left out there if even the usual friction laws err much more at
rest than in motion, which is asked of the recording and not of the model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from flexviz.analysis.estimation import (
    Covariance,
    Prior,
    Solved,
    TwoBandData,
    refine,
    start_values,
    torque_scale,
)
from flexviz.analysis.identification.uncertainty import Stated
from flexviz.analysis.motion import (
    MOTION,
    MotionContext,
    MotionFit,
    Phase,
    Phases,
    Residuals,
    deviations,
    one_by_one,
    usual_model,
)
from flexviz.base.arrays import Array, Bools
from flexviz.base.facts import Fact
from flexviz.base.units import joint_units
from flexviz.data.measurements import Group, MeasurementSet
from flexviz.model.effects import EFFECTS
from flexviz.model.equation import Layout, layout_of

TIGHT = 1e-3  # change of the objective that ends the last fit


@dataclass(frozen=True, eq=False)
class Estimate:
    """The parameters of a model.

    Attributes:
        layout, x: the model and its parameters, shape (P,).
        at_bound: shape (P,).
        stated: covariances of the parameters.
        prior: of the fit.
        start: shape (P,), where the fit began.
        refined: all of the band counts, and not that of the motion.
        at_noise: noise explains what is left.
        first_phase: shape (n,), first phase of each joint that counts.
        fact: how the fit went.
    """

    layout: Layout
    x: Array
    at_bound: Bools
    stated: Stated
    prior: Prior
    start: Array
    refined: bool
    at_noise: bool
    first_phase: Phases
    fact: Fact

    @property
    def covariances(self) -> tuple[Covariance, Covariance]:
        """With what the model lacks, and of chance alone."""
        return self.stated([self.at_bound])[0]


class Estimator:
    """Estimates the models of one set.

    Args:
        measurements: the set.
        groups: that are fitted; None: those of the set.
        context: signals in the band of the motion, if they are known.
    """

    def __init__(
        self,
        measurements: MeasurementSet,
        groups: Sequence[Group] | None = None,
        context: MotionContext | None = None,
    ) -> None:
        self.measurements = measurements
        self.groups = tuple(measurements.fit_groups if groups is None else groups)
        self._context = context
        self._first_phase: Phases | None = None if context is None else context.first_phase

    @property
    def context(self) -> MotionContext:
        """Signals in the band of the motion."""
        if self._context is None:
            left_out = [g for g in self.measurements.fit_groups if g not in self.groups]
            kept = tuple(g for g in self.measurements.groups if g not in left_out)
            given = replace(self.measurements, groups=kept)
            self._context = MotionContext(given, self.measurements.joints, stand_ins=True)
        return self._context

    def estimate(
        self,
        layout: Layout,
        x: Array,
        *,
        known: bool = False,
        check: Callable[[], None] = lambda: None,
        report: Callable[[Array, float, float], None] = lambda x, cost, step: None,
    ) -> Estimate:
        """The model fitted from x, shape (P,), or from its effects one by one where that ends lower.

        Args:
            layout: the model.
            x: start.
            known: whether x is the end of a search.
            check: called between steps; may raise to stop.
            report: called with x, cost and length of each step of a refinement.

        Raises:
            Stopped: `check` or `report` has stopped it.
        """
        motion = self.context.fit(layout, x, check=check)
        sigma, least = self.judged(motion)
        if self._first_phase is None and np.any(sigma > least):
            self._first_phase = self.standstill(check)
            if self._first_phase.any():
                motion = self.context.fit(layout, motion.x, check=check)
                sigma, least = self.judged(motion)
        errs = sigma > (1 + MOTION.noise_known) * least
        if errs.any() and not known and len(layout.effects) > 1:
            other = one_by_one(self.context, layout, check)
            if other.objective < motion.objective:
                motion = other
                sigma, least = self.judged(motion)
                errs = sigma > (1 + MOTION.noise_known) * least
        if not errs.any() or (layout.has_reversals and np.all(sigma < MOTION.far * least)):
            refined = self.refined(layout, motion.x, errs, least, check, report)
            if refined is not None:
                return refined
        return self.in_motion(layout, motion, check)

    def judged(self, fit: MotionFit) -> tuple[Array, Array]:
        """What a model leaves of each joint's recorded torque, and what of that counts, (n,) [Nm] each."""
        context = self.context
        parts = [Residuals(r, u, ()) for r, u in zip(fit.residuals, context.used, strict=True)]
        sigma = deviations(parts, MOTION.outlier) / torque_scale(fit.layout, fit.x)
        return sigma, context.least

    def refined(
        self,
        layout: Layout,
        x: Array,
        errs: Bools,
        least: Array,
        check: Callable[[], None],
        report: Callable[[Array, float, float], None],
    ) -> Estimate | None:
        """The refined model; None if it does not converge, or errs by more than counts."""
        two_band = TwoBandData(self.measurements, self.groups, layout, watch=check)
        start = start_values(self.measurements, two_band.narrow)
        try:
            found = refine(two_band, start.prior, start.bounds, start.bounds.clip(x), report=report)
        except np.linalg.LinAlgError:  # far from the noise, weights may be ill-conditioned
            return None
        if not found.converged:
            return None
        point = found.place
        above = np.sqrt(np.maximum(point.chi - 1.0, 0.0)) * self.context.noise_floor
        if errs.any() and np.any(np.hypot(above, np.sqrt(point.model_error)) > least):
            return None
        phase = np.full(layout.n, Phase.REST, np.int8)
        stated = partial(point.stated, start.prior, from_noise=point.at_noise)
        return Estimate(
            layout, point.x, found.at_bound, stated, start.prior, start.x, True, point.at_noise, phase,
            _refined(found, self.measurements.robot.prismatic),
        )  # fmt: skip

    def in_motion(self, layout: Layout, motion: MotionFit, check: Callable[[], None]) -> Estimate:
        """The model in the band of the motion."""
        context = self.context
        counted = context.first_phase.copy()
        for effect in layout.effects:
            if EFFECTS[effect.effect].after_rest:
                counted[effect.place.own_joint] = min(counted[effect.place.own_joint], Phase.START)
        context.first_phase = counted
        return self.of_motion(context.fit(layout, motion.x, check=check, settled=TIGHT))

    def of_motion(self, fit: MotionFit) -> Estimate:
        """A fit in the band of the motion as an estimate."""
        context, layout = fit.context, fit.layout
        start = context.start(layout)

        def stated(held: Sequence[Bools]) -> list[tuple[Covariance, Covariance]]:
            return [fit.covariances(one) for one in held]

        phase, fact = context.first_phase.copy(), Fact("converged-in-motion")
        return Estimate(layout, fit.x, fit.at_bound, stated, start.prior, start.x, False, False, phase, fact)

    def standstill(self, check: Callable[[], None]) -> Phases:
        """The first phase of each joint that counts, decided on a model with all usual effects."""
        context, own = self.context, layout_of(self.measurements)
        context.first_phase = np.full(own.n, Phase.REST, np.int8)
        if any(bool(np.any(phase < Phase.MOTION)) for phase in context.phases):
            usual = usual_model(context, own)
            context.set_standstill_apart(context.fit(usual.layout, usual.x, check=check))
        return context.first_phase


def _refined(found: Solved, slides: Bools) -> Fact:
    """The model error of each joint that was allowed for [Nm], if any, and χ² per sample."""
    place = found.place
    added = tuple(np.sqrt(place.model_error).tolist()) if place.model_error.any() else ()
    values = {"model_error": added, "chi_square": float(np.mean(place.chi))}
    return Fact("refined", values=values | {"units": joint_units("Nm", slides)})
