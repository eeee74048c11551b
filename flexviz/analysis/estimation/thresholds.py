"""Decision thresholds of the estimator."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class EstimationThresholds:
    """Thresholds for the course of a fit, its prior and the source of its covariance.

    `python -m benchmarks.thresholds` shows what `noise_explains` and the prior spreads of stiffness, motor
    inertia and friction decide, on simulated two-joint arms. With an unmodelled friction that raises χ²,
    actual errors were 1.7 (noise model) and 1.8 times (spectra) the predicted ones at χ² = 1.02, 2.1 and 1.4
    times at 1.24, 2.8 and 1.4 times at 2.0: from about 1.2 on, the spectra are the better source. With these
    spreads a third or three times as wide, no parameter that the data determine moves by more than 0.001
    standard errors. The other values, including the spreads of effects, are based on experience; no study
    supports them yet.

    Attributes:
        consistent: mean χ² per sample up to which measurement noise alone explains the residual; above it a
            white model error is added.
        first_model_error: initial standard deviation of the model error, relative to the rms torque.
        noise_explains: mean χ² per sample below which the covariance of the score is computed from the noise
            model; above it from the residual's own spectra.
        transient: energy of a window at the ends of a record, relative to the median, that marks a transient.
        negligible_step: step length that ends the refinement [standard deviations].
        noise_moved: change of the noise shape (logs of its variances) after which the whiteners are renewed.
        noise_moved_far: the same far above the noise, or with a model error, where weights matter less.
        far_above_noise: mean χ² per sample from which a fit counts as far above the noise; nearer, an uphill
            step may well lead to the solution.
        effect_moved: relative change of an effect after which its reversals are located again.
        deflection_guess: assumed deflection under the rms torque of a joint without rough stiffness [rad].
        stiffness_spread: log of the prior standard deviation of a stiffness or motor inertia, relative to its
            start value (e³ = 20).
        viscous_spread: prior standard deviation of viscous friction, relative to its start value ...
        viscous_torque: ... and at least this share of the rms torque at the rms velocity.
        torque_spread: prior standard deviation of an effect's torque, relative to the rms torque.
        coefficient_spread: of its other coefficients, relative to their scale from rms torque, velocity and
            stiffness.
        other_spread: of its remaining parameters, relative to their example, or one if larger.
    """

    consistent: float = 2.0
    first_model_error: float = 3e-4
    noise_explains: float = 1.2
    transient: float = 5.0
    negligible_step: float = 0.02
    noise_moved: float = 0.01
    noise_moved_far: float = 0.1
    far_above_noise: float = 100.0
    effect_moved: float = 0.1
    deflection_guess: float = 5e-3
    stiffness_spread: float = 3.0
    viscous_spread: float = 2.0
    viscous_torque: float = 0.05
    torque_spread: float = 3.0
    coefficient_spread: float = 10.0
    other_spread: float = 30.0


ESTIMATION = EstimationThresholds()
