"""Thresholds of the estimator, in one place with their reasons."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class EstimationThresholds:
    """What decides how a fit goes on and where its uncertainty comes from.

    Attributes:
        consistent: mean χ² per sample up to which measurement noise alone explains the residual; above it a
            white model error is added.
        first_model_error: first guess of the model error's standard deviation, relative to the torque's rms.
        model_error_settled: χ² per sample and joint below which the model error is large enough.
        noise_explains: mean χ² per sample below which the covariance of the score is computed from the noise
            model; above it from the residual's own spectra.
        transient: a window at the end of a record is dropped where it is this many times as loud as usual.
        negligible_step: length of a step that ends the refinement [standard deviations].
        noise_moved: change of the noise's shape (logs of its variances) after which the residual is whitened
            anew.
        effect_moved: relative change of an effect after which its reversals are located anew.
    """

    consistent: float = 2.0
    first_model_error: float = 3e-4
    model_error_settled: float = 1.5
    noise_explains: float = 1.2
    transient: float = 5.0
    negligible_step: float = 0.02
    noise_moved: float = 0.01
    effect_moved: float = 0.1


ESTIMATION = EstimationThresholds()
