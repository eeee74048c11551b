"""Weighted residual and instruments at one x, and their weighting along a fit."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from flexviz.equation import LinkTerms, OperatingPoint
from flexviz.estimation.covariance import score_covariance
from flexviz.estimation.descent import NormalEquations
from flexviz.estimation.noise_weighting import NoiseWeighting
from flexviz.estimation.prior import Prior
from flexviz.estimation.thresholds import ESTIMATION
from flexviz.estimation.transients import outside_transients
from flexviz.estimation.two_band import BandEvaluation, TwoBandData
from flexviz.estimation.whitening import Whitener
from flexviz.recent import Recent

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

INSTRUMENTS = partial(Recent, "instruments", 2, attrgetter("nbytes"), 2e8)  # of long records one point's


@dataclass(frozen=True, eq=False)
class Point:
    """Whitened residual and instruments at one x.

    Attributes:
        two_band: the data and the model.
        x: shape (P,).
        r: shape (N, n); unused samples are zero.
        used: shape (N,), samples outside the transients.
        weightings: one per block.
        torque: shape (N, n), transmission torque of the narrow band [Nm].
        narrow_point: operating point of the narrow band.
        wide_point: that of the wide band; None unless instruments need it.
        bias: mean of zᵀ r per sample due to shared noise, shape (P,), one per block.
        transients: Σ N log max(χ_j, 1) of the unused samples, each window with its own χ_j.
    """

    two_band: TwoBandData
    x: Array
    r: Array
    used: Bools
    weightings: list[NoiseWeighting]
    torque: Array
    narrow_point: OperatingPoint
    wide_point: OperatingPoint | None
    bias: list[Array]
    transients: float = 0.0
    _instruments: Recent[Array] = field(default_factory=INSTRUMENTS, init=False)
    _link: Recent[LinkTerms] = field(default_factory=partial(Recent, "link", 4), init=False)

    @property
    def z(self) -> Array:
        """Instruments, shape (N, n, P); unused samples are zero."""
        found = partial(self.two_band.instruments, wide=self.wide_point, x=self.x)
        return self._instruments.get(lambda: self._weighted(found(self.jacobian())))

    @property
    def link(self) -> LinkTerms:
        """Rigid-body terms of the narrow band."""
        return self._link.get(lambda: self.narrow_point.link_terms(self.x))

    def jacobian(self) -> Array:
        """∂r/∂x of the narrow band, shape (N, n, P)."""
        return self.narrow_point.evaluate(self.x, moving=True).jacobian

    def _weighted(self, jacobian: Array) -> Array:
        for weighting, rows in zip(self.weightings, self.rows, strict=True):
            jacobian[rows] = weighting.apply(jacobian[rows])
        jacobian[~self.used] = 0.0
        return jacobian

    def forget(self) -> None:
        """Discard the signals at the operating point, which can be computed again."""
        for point in filter(None, (self.narrow_point, self.wide_point)):
            point.context.forget()

    @property
    def whiteners(self) -> list[Whitener]:
        """One per block."""
        return [w.whitener for w in self.weightings]

    @property
    def rows(self) -> list[slice]:
        """Samples of each block."""
        return [b.rows for b in self.two_band.blocks]

    @property
    def chi(self) -> Array:
        """Mean square of each joint's whitened residual, shape (n,); 1 for noise."""
        return np.sum(self.r**2, axis=0) / max(np.count_nonzero(self.used), 1)

    @property
    def noise_objective(self) -> float:
        """Σ_j N log max(χ_j, 1): twice the negative log likelihood of residuals above their noise.

        With that of the transients, which another model may not have.
        """
        return float(self.objective_by_joint.sum()) + self.transients

    @property
    def objective_by_joint(self) -> Array:
        """N log max(χ_j, 1) of each joint, shape (n,)."""
        return float(np.count_nonzero(self.used)) * np.log(np.maximum(self.chi, 1.0))

    @property
    def objective(self) -> float:
        """`noise_objective` plus the cost of nuisance pulses."""
        return self.noise_objective + sum(m.log_determinant for m in self.weightings)

    def objective_after(self, decrease: float) -> float:
        """Lower limit of the objective after a decrease of Σ r², which no joint shares with the others.

        Transients may be gone.
        """
        count = max(np.count_nonzero(self.used), 1)
        return count * float(np.log(np.maximum(self.chi - decrease / count, 1.0)).sum())

    def within(self, window: Bools) -> Point:
        """The point restricted to the samples of a window, shape (N,)."""
        part = replace(self, r=self.r * window[:, None], used=self.used & window, transients=0.0)
        part._instruments.get(lambda: self.z * window[:, None, None])
        return part

    def score(self) -> Array:
        """Zᵀ W r − b, shape (P,), of zero mean for a correct model."""
        score: Array = self.z.reshape(-1, len(self.x)).T @ self.r.ravel()
        for rows, mean in zip(self.rows, self._corrected_bias(), strict=True):
            score -= np.count_nonzero(self.used[rows]) * mean
        return score

    def sample_scores(self) -> Array:
        """Contribution of each sample to the score, shape (N, P)."""
        each = np.einsum("tjp,tj->tp", self.z, self.r)
        for rows, mean in zip(self.rows, self._corrected_bias(), strict=True):
            each[rows] -= self.used[rows, None] * mean
        return each

    def _corrected_bias(self) -> list[Array]:
        """b per sample, shape (P,), one per block.

        Reduced for joints whose residual is below the estimated noise (torque chatter, for example, is not
        noise).
        """
        layout = self.two_band.layout
        chi = np.sum(self.r[self.used] ** 2, axis=0) / max(np.count_nonzero(self.used), 1)
        share = np.zeros(layout.size)
        share[layout.compliance] = np.minimum(chi, 1.0)
        for effect, where in layout.effect_slices():
            if effect.joint is not None:
                share[where] = min(chi[effect.joint], 1.0)
        return [share * mean for mean in self.bias]

    def normal_equations(self, prior: Prior) -> NormalEquations:
        """Normal equations of the weighted residual and the prior."""
        gradient, prior_hessian = prior.gradient_and_hessian(self.x)
        flat = self.z.reshape(-1, len(self.x))
        return NormalEquations(gradient + self.score(), flat.T @ flat, prior_hessian)

    def score_covariance(self) -> Array:
        """Covariance of the score from the residual's own spectra, shape (P, P)."""
        return score_covariance(self.r, self.z, self.rows)

    def noise_score_covariance(self) -> Array:
        """Covariance of the score from the noise model, scaled up to the size of the residual."""
        two_band, raised = self.two_band, max(float(np.mean(self.chi)), 1.0)
        return two_band.noise_score_covariance(self.x, self.link, self.z, self.weightings) * raised


def weighted_point(
    two_band: TwoBandData, evaluation: BandEvaluation, weightings: list[NoiseWeighting], bias: list[Array]
) -> Point:
    """An evaluation in units of the noise; its Jacobian is used up."""
    pairs = list(zip(weightings, two_band.blocks, strict=True))
    r = np.concatenate([m.apply(evaluation.residual[b.rows]) for m, b in pairs])
    ends, costs = zip(*(outside_transients(r[b.rows]) for b in two_band.blocks), strict=True)
    used, transients = np.concatenate(ends), float(sum(costs))
    r[~used] = 0.0
    narrow, jacobian = evaluation.narrow_point, evaluation.jacobian
    wide = evaluation.wide_point if two_band.wide_columns.size else None
    x, torque = evaluation.x, evaluation.torque
    point = Point(two_band, x, r, used, weightings, torque, narrow, wide, bias, transients)
    point._link.get(lambda: evaluation.link)
    if jacobian is not None:
        point._instruments.get(lambda: point._weighted(jacobian))
    return point


class Whitening:
    """Weighted points along a fit, whitened once; subclasses renew the weighting as the fit proceeds.

    Args:
        two_band: the data and the model.
        after: evaluation of an earlier fit.
        window: shape (N,), samples to use; default: all.
    """

    def __init__(
        self,
        two_band: TwoBandData,
        *,
        after: BandEvaluation | None = None,
        window: Bools | None = None,
    ) -> None:
        self.two_band, self.evaluation = two_band, after
        self._window = window
        self._with_instruments = True
        self._whiteners: list[Whitener] | None = None
        self._weightings: list[NoiseWeighting] | None = None
        self._bias: list[Array] | None = None

    def point(self, x: Array) -> Point:
        """Residual and instruments at x, shape (P,)."""
        here = self.two_band.evaluate(x, self.evaluation, self._with_instruments)
        self.evaluation = replace(here, jacobian=None)
        self._renew(here)
        link = here.link
        if self._whiteners is None:
            self._whiteners = self.two_band.whiteners(x, link)
            self._weightings = self._bias = None
        if self._bias is None:
            self._bias = self._instrument_bias(x, here)
        if self._weightings is None:
            self._weightings = self.two_band.weightings(here, self._whiteners)
        point = weighted_point(self.two_band, here, self._weightings, self._bias)
        return point if self._window is None else point.within(self._window)

    def _renew(self, here: BandEvaluation) -> None:
        """Discard the parts of the weighting that are outdated at this evaluation."""

    def _instrument_bias(self, x: Array, here: BandEvaluation) -> list[Array]:
        assert self._whiteners is not None
        return self.two_band.instrument_bias(x, here.link, self._whiteners)


class EarlyWhitening(Whitening):
    """Whitening renewed at each of the first steps, while the parameters still change considerably."""

    STEPS = 2

    def __init__(self, two_band: TwoBandData, after: BandEvaluation | None = None) -> None:
        super().__init__(two_band, after=after)
        self._count = 0

    def _renew(self, here: BandEvaluation) -> None:
        if self._count < self.STEPS:
            self._whiteners = None
        self._weightings = self._bias = None
        self._count += 1


class ModelErrorWhitening(Whitening):
    """Whitening with a model error that follows the residual from point to point.

    The model error is added if the measurement noise does not explain the residual.
    """

    def point(self, x: Array) -> Point:
        point = super().point(x)
        error, chi = self.two_band.noise_model.model_error, point.chi
        if error.any() or float(chi.mean()) > ESTIMATION.consistent:
            error = error if error.any() else first_model_error(point.torque)
            self.two_band = self.two_band.with_model_error(error * np.maximum(chi, 0.5))
            self._whiteners = None
        return point


class TrackingWhitening(Whitening):
    """Whitening renewed only when the noise shape or the reversals of an effect have changed.

    Args:
        two_band: the data and the model.
        near: whiteners of a nearby point and the noise shape for which they were computed.
        judging: only the residual is needed, neither instruments nor their bias.
    """

    def __init__(
        self,
        two_band: TwoBandData,
        near: tuple[list[Whitener], Array] | None = None,
        judging: bool = False,
    ) -> None:
        super().__init__(two_band)
        self._with_instruments, self._effects_at = not judging, np.zeros(0)
        self.noise_at, self._far = np.zeros(0), False
        if near is not None:
            self._whiteners, self.noise_at = near

    def point(self, x: Array) -> Point:
        point = super().point(x)
        before, self._far = self._far, float(point.chi.mean()) > ESTIMATION.far_above_noise
        if before and not self._far:
            self._bias = None  # was left out
            point = super().point(x)
        return point

    def _renew(self, here: BandEvaluation) -> None:
        noise = self.two_band.noise_shape(here.x, here.link)
        enough = ESTIMATION.noise_moved_far if self._far else ESTIMATION.noise_moved
        if self._whiteners is None or np.max(np.abs(noise - self.noise_at)) > enough:
            self._whiteners, self.noise_at = None, noise
        effects = here.x[self.two_band.layout.effect_start :]
        if self._weightings is not None and effects.size:
            scale = np.abs(effects) + np.abs(self._effects_at) + 1e-300
            if np.max(np.abs(effects - self._effects_at) / scale) > 0.5 * ESTIMATION.effect_moved:
                self._weightings = None
        if self._whiteners is None or self._weightings is None:
            self._effects_at = effects.copy()

    def _instrument_bias(self, x: Array, here: BandEvaluation) -> list[Array]:
        if not self._with_instruments:
            return []
        if self._far:  # what the sensors' noise shares is nothing beside what the model leaves
            return [np.zeros(len(x)) for _ in self.two_band.blocks]
        return super()._instrument_bias(x, here)


def first_model_error(torque: Array) -> Array:
    """Initial variance of the model error, shape (n,) [Nm²], from torques (N, n)."""
    return ESTIMATION.first_model_error**2 * np.mean(torque**2, axis=0)
