"""Thresholds of the estimator, in one place with their reasons."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class EstimationThresholds:
    """What decides how a fit goes on and where its uncertainty comes from.

    `python -m benchmarks.thresholds` shows what `noise_explains` and the prior spreads of stiffness, motor
    inertia and friction decide, on simulated two-joint arms. With an unmodelled friction that raises χ²,
    actual errors were 1.7 (noise model) and 1.8 times (spectra) the predicted ones at χ² = 1.02, 2.1 and 1.4
    times at 1.24, 2.8 and 1.4 times at 2.0: from about 1.2 on, the spectra are the better source. With these
    spreads a third or three times as wide, no parameter that the data determine moves by more than 0.001
    standard errors. The other values, the spreads of effects among them, are experience: no study supports
    them yet.

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
        deflection_guess: [rad] a joint without a rough stiffness is taken to deflect by this under its rms
            torque.
        stiffness_spread: natural log of the factor by which a stiffness or motor inertia is one standard
            deviation of the prior away from its start value (e³ = 20).
        viscous_spread: the same for viscous friction, relative to its start value.
        viscous_torque: and at least as much as makes this share of the rms torque at the rms velocity.
        torque_spread: of an effect's torque, relative to the rms torque.
        coefficient_spread: of its other coefficients, relative to the size that the rms torque, velocity and
            the stiffness give them.
        other_spread: of its remaining parameters, relative to their example, at least one.
    """

    consistent: float = 2.0
    first_model_error: float = 3e-4
    model_error_settled: float = 1.5
    noise_explains: float = 1.2
    transient: float = 5.0
    negligible_step: float = 0.02
    noise_moved: float = 0.01
    effect_moved: float = 0.1
    deflection_guess: float = 5e-3
    stiffness_spread: float = 3.0
    viscous_spread: float = 2.0
    viscous_torque: float = 0.05
    torque_spread: float = 3.0
    coefficient_spread: float = 10.0
    other_spread: float = 30.0


ESTIMATION = EstimationThresholds()
