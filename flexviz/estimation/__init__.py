"""Estimation core: noise model, two-band data, instrumental variables, covariance, prior and start values."""

from flexviz.estimation.base_inertials import BaseParameters, base_parameters
from flexviz.estimation.covariance import Covariance, sandwich, score_covariance, spectral_covariance
from flexviz.estimation.descent import Descent, NormalEquations, Place, Problem, Reach
from flexviz.estimation.error_band import BAND_HERTZ, LONGEST_EDGE, ErrorBand, PredictionErrors
from flexviz.estimation.instrumental_variables import MAX_ITERATIONS, Solved, refine, solve
from flexviz.estimation.least_squares import Solution, Stopped, gauss_newton, normal_equations
from flexviz.estimation.linear_algebra import Bounds, bounded_step, scaled_inverse
from flexviz.estimation.model_error import FittedModel, with_model_error
from flexviz.estimation.noise_model import WIDE_HERTZ, WeightingSettings
from flexviz.estimation.noise_propagation import TAU, NoisePath, Transfer, noise_density, noise_paths
from flexviz.estimation.noise_weighting import whitened
from flexviz.estimation.prior import Prior, pseudo_inertia, torque_scale
from flexviz.estimation.score_test import (
    Projection,
    ScoredCandidate,
    Weigh,
    best_intervals,
    explained,
    score,
    shares_alone,
)
from flexviz.estimation.start import Start, other_effects, start_values
from flexviz.estimation.thresholds import ESTIMATION
from flexviz.estimation.two_band import NARROW_HERTZ, TwoBandData, residual_noise
from flexviz.estimation.unknown_input import SIDES, Side, UnknownInput
from flexviz.estimation.weighted_point import Point, Whitening
from flexviz.estimation.whitening import Whitener
