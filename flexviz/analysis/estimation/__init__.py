"""Estimation core: noise model, two-band data, instrumental variables, covariance, prior and start values."""

from flexviz.analysis.estimation.base_inertials import BaseParameters, base_parameters
from flexviz.analysis.estimation.covariance import Covariance, sandwich, score_covariance, spectral_covariance
from flexviz.analysis.estimation.descent import Descent, NormalEquations, Place, Problem, Reach
from flexviz.analysis.estimation.error_band import BAND_HERTZ, LONGEST_EDGE, ErrorBand, PredictionErrors
from flexviz.analysis.estimation.instrumental_variables import MAX_ITERATIONS, Solved, refine, solve
from flexviz.analysis.estimation.least_squares import Solution, Stopped, gauss_newton, normal_equations
from flexviz.analysis.estimation.linear_algebra import Bounds, bounded_step, scaled_inverse
from flexviz.analysis.estimation.model_error import FittedModel, with_model_error
from flexviz.analysis.estimation.noise_model import WIDE_HERTZ, WeightingSettings
from flexviz.analysis.estimation.noise_propagation import TAU, NoisePath, Transfer, noise_density, noise_paths
from flexviz.analysis.estimation.noise_weighting import whitened
from flexviz.analysis.estimation.prior import Prior, pseudo_inertia, torque_scale
from flexviz.analysis.estimation.score_test import (
    Projection,
    ScoredCandidate,
    Weigh,
    best_intervals,
    explained,
    score,
    shares_alone,
)
from flexviz.analysis.estimation.start import Start, other_effects, start_values
from flexviz.analysis.estimation.thresholds import ESTIMATION
from flexviz.analysis.estimation.two_band import NARROW_HERTZ, TwoBandData, residual_noise
from flexviz.analysis.estimation.unknown_input import SIDES, Side, UnknownInput
from flexviz.analysis.estimation.weighted_point import Point, Whitening
from flexviz.analysis.estimation.whitening import Whitener
