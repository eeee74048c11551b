"""Weighted residual and instruments at one x, and their weighting along a fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from operator import attrgetter

import numpy as np

from flexviz.analysis.estimation.covariance import Covariance, sandwich, spectral_covariance
from flexviz.analysis.estimation.descent import NormalEquations
from flexviz.analysis.estimation.model_error import FittedModel, with_model_error
from flexviz.analysis.estimation.noise_weighting import NoiseWeighting
from flexviz.analysis.estimation.prior import Prior
from flexviz.analysis.estimation.thresholds import ESTIMATION
from flexviz.analysis.estimation.transients import outside_transients
from flexviz.analysis.estimation.two_band import BandEvaluation, TwoBandData
from flexviz.analysis.estimation.whitening import Whitener
from flexviz.base.arrays import Array, Bools
from flexviz.base.recent import Recent
from flexviz.model.equation import Chain, LinkTerms, OperatingPoint

FALLING = 0.3  # least factor beyond χ² by which a model error that is too large falls in one step
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
        noise_at: noise shape for which the whiteners were computed (`TwoBandData.noise_shape`).
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
    noise_at: Array
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
    def model_error(self) -> Array:
        """Variance of the model error that was added to the noise, shape (n,) [Nm²]."""
        return self.two_band.noise_model.model_error

    @property
    def rows(self) -> list[slice]:
        """Samples of each block."""
        return [b.rows for b in self.two_band.blocks]

    @property
    def counted(self) -> Bools:
        """Samples and joints that count, shape (N, n): outside the transients, and of known torque."""
        return self.used[:, None] & self.two_band.known

    @property
    def chi(self) -> Array:
        """Mean square of each joint's whitened residual, shape (n,); 1 for noise, and without a torque."""
        found = np.sum(self.r**2, axis=0) / np.maximum(self.counted.sum(axis=0), 1)
        return np.where(self.two_band.layout.fitted, found, 1.0)

    @property
    def noise_objective(self) -> float:
        """Σ_j N_j log max(χ_j, 1): twice the negative log likelihood of residuals above their noise.

        With that of the transients, which another model may not have.
        """
        counts = self.counted.sum(axis=0)
        return float(counts @ np.log(np.maximum(self.chi, 1.0))) + self.transients

    @property
    def objective(self) -> float:
        """`noise_objective` plus the cost of nuisance pulses."""
        return self.noise_objective + sum(m.log_determinant for m in self.weightings)

    def score(self) -> Array:
        """Zᵀ W r − b, shape (P,), of zero mean for a correct model."""
        score: Array = self.z.reshape(-1, len(self.x)).T @ self.r.ravel()
        for rows, mean in zip(self.rows, self._corrected_bias(), strict=True):
            score -= np.count_nonzero(self.used[rows]) * mean
        return score

    def _corrected_bias(self) -> list[Array]:
        """b per sample, shape (P,), one per block.

        Reduced for joints whose residual is below the estimated noise (torque chatter, for example, is not
        noise).
        """
        layout, below = self.two_band.layout, np.minimum(self.chi, 1.0)
        share = np.zeros(layout.size)
        share[layout.compliance] = below
        for effect, where in layout.effect_slices():
            if effect.joint is not None:
                share[where] = below[effect.joint]
        return [share * mean for mean in self.bias]

    def normal_equations(self, prior: Prior) -> NormalEquations:
        """Normal equations of the weighted residual and the prior."""
        gradient, prior_hessian = prior.gradient_and_hessian(self.x)
        flat = self.z.reshape(-1, len(self.x))
        return NormalEquations(gradient + self.score(), flat.T @ flat, prior_hessian)

    def covariance(self, prior: Prior, from_noise: bool = False, at_bound: Bools | None = None) -> Covariance:
        """Of the parameters: from the residual's spectra, or from the noise, scaled up to the residual."""
        hessian, measured = prior.gradient_and_hessian(self.x)[1], prior.measured(self.x)
        if not from_noise:
            return spectral_covariance(self.r, self.z, self.rows, hessian, at_bound, measured)
        raised, flat = max(float(np.mean(self.chi)), 1.0), self.z.reshape(-1, len(self.x))
        score = self.two_band.noise_score_covariance(self.x, self.link, self.z, self.weightings) * raised
        return sandwich(flat.T @ flat, score, hessian, at_bound, measured)

    def weigh(self, columns: Array, block: int) -> Array:
        """Columns of a block, shape (m, n, k), weighted like the residual, shape (m n, k)."""
        self.two_band.watch()
        out = self.weightings[block].apply(columns)
        out[~self.used[self.rows[block]]] = 0.0
        return out.reshape(-1, columns.shape[2])

    @property
    def at_noise(self) -> bool:
        """Whether noise explains the residual."""
        return float(np.mean(self.chi)) < ESTIMATION.noise_explains and not self.model_error.any()

    def stated(
        self, prior: Prior, held: Sequence[Bools], from_noise: bool = False
    ) -> list[tuple[Covariance, Covariance]]:
        """`covariance` with parameters held, (P,) each: with what the model lacks, and of chance alone.

        The model lacks something where noise does not explain the residual.
        """
        chance = [self.covariance(prior, from_noise, one) for one in held]
        if self.at_noise:
            return [(one, one) for one in chance]
        layout, x = self.two_band.layout, self.x
        chain = Chain(x[layout.compliance], x[layout.link_viscous], self.link)
        z, hessian = self.z.reshape(-1, layout.size), prior.gradient_and_hessian(x)[1]
        fits = [
            FittedModel(self.narrow_point, chain, self.weigh, self.r.ravel(), z, hessian, one) for one in held
        ]
        excess = np.maximum(self.chi - (self.model_error == 0), 0.0)
        return list(zip(with_model_error(chance, fits, excess), chance, strict=True))


def weighted_point(
    two_band: TwoBandData,
    evaluation: BandEvaluation,
    weightings: list[NoiseWeighting],
    bias: list[Array],
    noise_at: Array,
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
    point = Point(two_band, x, r, used, weightings, torque, narrow, wide, bias, noise_at, transients)
    point._link.get(lambda: evaluation.link)
    if jacobian is not None:
        point._instruments.get(lambda: point._weighted(jacobian))
    return point


class Whitening:
    """Weighted points along a fit, whitened anew where the noise or the reversals of an effect have changed.

    Args:
        two_band: the data and the model.
        near: a point of the same data, whose whiteners can be reused.
        judging: only the residual is needed, neither instruments nor their bias.
        adapted: a white model error follows the residual from point to point, once the noise does not explain
            it: the noise alone would give misleading weights.
    """

    def __init__(
        self,
        two_band: TwoBandData,
        near: Point | None = None,
        *,
        judging: bool = False,
        adapted: bool = False,
    ) -> None:
        self.two_band, self._judging, self._adapted = two_band, judging, adapted
        self._whiteners = None if near is None else near.whiteners
        self._noise_at = np.zeros(0) if near is None else near.noise_at
        self._effects_at, self._far = np.zeros(0), False
        self._error_at, self._least_error = two_band.noise_model.model_error, np.zeros(two_band.layout.n)
        self._weightings: list[NoiseWeighting] | None = None
        self._bias: list[Array] | None = None
        self._before: BandEvaluation | None = None

    def point(self, x: Array) -> Point:
        """Residual and instruments at x, shape (P,)."""
        point = self._point(x)
        before, self._far = self._far, float(point.chi.mean()) > ESTIMATION.far_above_noise
        if before and not self._far:
            self._bias = None  # was left out
            point = self._point(x)
        chi, error = point.chi, self._error_at
        if self._adapted and (error.any() or float(chi.mean()) > ESTIMATION.consistent):
            self._least_error = ESTIMATION.first_model_error**2 * np.mean(point.torque**2, axis=0)
            error = np.where(error > 0, error, self._least_error) * chi * np.clip(chi, FALLING, 1.0)
            self.two_band = self.two_band.with_model_error(error)
        return point

    def _point(self, x: Array) -> Point:
        two_band = self.two_band
        here = two_band.evaluate(x, self._before, not self._judging)
        self._before = replace(here, jacobian=None)
        self._renew(here)
        if self._whiteners is None:
            self._whiteners = two_band.whiteners(x, here.link)
            self._weightings = self._bias = None
        if self._bias is None:
            self._bias = self._instrument_bias(here, self._whiteners)
        if self._weightings is None:
            self._weightings = two_band.weightings(here, self._whiteners)
        return weighted_point(two_band, here, self._weightings, self._bias, self._noise_at)

    def _renew(self, here: BandEvaluation) -> None:
        """Discard the parts of the weighting that are outdated at this evaluation."""
        error, noise = self.two_band.noise_model.model_error, self.two_band.noise_shape(here.x, here.link)
        enough = ESTIMATION.noise_moved_far if self._far or error.any() else ESTIMATION.noise_moved
        moved = len(self._noise_at) == 0 or float(np.max(np.abs(noise - self._noise_at))) > enough
        if moved or np.any(np.abs(error - self._error_at) > enough * self._error_at + self._least_error):
            self._whiteners, self._noise_at, self._error_at = None, noise, error
        effects = here.x[self.two_band.layout.effect_start :]
        if self._weightings is not None and effects.size:
            scale = np.abs(effects) + np.abs(self._effects_at) + 1e-300
            if np.max(np.abs(effects - self._effects_at) / scale) > 0.5 * ESTIMATION.effect_moved:
                self._weightings = None
        if self._whiteners is None or self._weightings is None:
            self._effects_at = effects.copy()

    def _instrument_bias(self, here: BandEvaluation, whiteners: list[Whitener]) -> list[Array]:
        if self._judging:
            return []
        if self._far:  # what the sensors' noise shares is nothing compared with what the model leaves
            return [np.zeros(len(here.x)) for _ in self.two_band.blocks]
        return self.two_band.instrument_bias(here.x, here.link, whiteners)
