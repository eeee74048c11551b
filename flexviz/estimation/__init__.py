"""Estimation core: noise model, two-band data, instrumental variables, covariance, prior and start values."""

from flexviz.estimation.base_parameters import BaseParameters, base_parameters
from flexviz.estimation.covariance import covariance, score_covariance
from flexviz.estimation.instrumental_variables import (
    CONSISTENT,
    TOLERANCE,
    Point,
    Refined,
    compensated_score,
    evaluated,
    feasible_step,
    refine,
    shared_part,
    weighted_point,
)
from flexviz.estimation.interval import best_intervals
from flexviz.estimation.least_squares import Bounds, Solution, Stopped, bounded_step, gauss_newton
from flexviz.estimation.noise_paths import NoisePath, Transfer, noise_paths
from flexviz.estimation.prior import Prior, pseudo_inertia
from flexviz.estimation.projection import Projection, Weigh
from flexviz.estimation.scoring import Scored, explained, score
from flexviz.estimation.start import Start, other_effects, start_values
from flexviz.estimation.two_band import WIDE_HERTZ, TwoBandData, residual_noise
from flexviz.estimation.whitening import Whitener, noise_kernel, whitener

__all__ = [
    "CONSISTENT",
    "TOLERANCE",
    "WIDE_HERTZ",
    "BaseParameters",
    "Bounds",
    "NoisePath",
    "Point",
    "Prior",
    "Projection",
    "Refined",
    "Scored",
    "Solution",
    "Start",
    "Stopped",
    "Transfer",
    "TwoBandData",
    "Weigh",
    "Whitener",
    "base_parameters",
    "best_intervals",
    "bounded_step",
    "compensated_score",
    "covariance",
    "evaluated",
    "explained",
    "feasible_step",
    "gauss_newton",
    "noise_kernel",
    "noise_paths",
    "other_effects",
    "pseudo_inertia",
    "refine",
    "residual_noise",
    "score",
    "score_covariance",
    "shared_part",
    "start_values",
    "weighted_point",
    "whitener",
]
