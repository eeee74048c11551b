"""Thresholds of the diagnosis: what each decides, why it has this value, and what supports it.

Unless a group says otherwise, the values were set on development cases and are supported by the study of
unseen ones, `python -m benchmarks.diagnosis_study all --work DIR` (docs/diagnosis-study.md): a change
has to keep its rates of right names and false alarms. Gains are falls of the objective
Σ_j N log max(χ_j, 1) + k log N. The excess of a fit is its mean χ² per sample above the noise.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class AcceptanceThresholds:
    """When an effect is added, and what the last model is called."""

    least_gain: float = 100.0  # no false alarm over all candidates tried
    least_gain_share: float = 0.003  # of the gain before it: an approximate law leaves traces
    least_gain_share_episode: float = 0.03  # the same for an episode, which can imitate much
    least_excess_share: float = 0.1  # of the excess removed, or the effect is not worth a name ...
    large_gain_share: float = 0.3  # ... unless it gains this share of the objective above the noise
    structured_excess: float = 1.5  # beyond it the residual is structured, not noise
    trace_share: float = 1e-7  # of the first excess: allowed besides, as no law is exact
    trace_share_hidden_state: float = 1e-6  # the same beside friction with a state that no encoder measures
    nested_gain: float = 12.0  # over the simpler law that an effect refines, or the simpler one is taken
    offset_gain: float = 50.0  # lead of a gap that is never crossed over effects that are more than an offset
    superfluous_gain: float = 100.0  # an earlier effect that is worth less now is dropped


@dataclass(frozen=True)
class SearchThresholds:
    """Which candidates are refitted, from where, and for how long."""

    rounds: int = 5  # effects that are added at most
    refitted: int = 6  # candidates with the best scores
    refitted_episodes: int = 2  # episodes among them
    kept_signatures: int = 12  # of the leading candidates, for correlations
    close_score: float = 0.03  # of the best: lower ones are not refitted once the best explains everything
    explained_excess: float = 0.2  # share of the excess left by a candidate that explains everything
    # the same where little excess is left, because noise alone scatters by as much; verdicts and values of
    # five sets of two joints are equal to 1e-9 for 0.02, 0.05, 0.1 and 0.2
    explained_floor: float = 0.05
    noise_reached: float = 0.15  # excess at which no other start is tried
    far_off: float = 5.0  # excess from which on a fit may be far off and candidates start afresh, too
    hidden_excess: float = 0.5  # above it, effects with a low score are tried as well
    hidden_removed: float = 0.3  # share of the excess that such an effect has to remove later in the search
    hidden_joints: int = 2  # joints with the largest residual on which they are tried
    longest_episode: float = 0.6  # of a group: a torque that acts longer is not an episode
    rival_deficit: float = 0.3  # of the leader's gain: a rival further behind is not followed
    first_iterations: int = 12  # of the fit that everything begins with
    short_refit: int = 3  # iterations
    longer_refit: int = 6
    full_refit: int = 14
    last_refit: int = 20


@dataclass(frozen=True)
class ModelErrorThresholds:
    """The search beside a white model error, where no model reaches the noise.

    `python -m benchmarks.real` shows what it does on a real robot.
    """

    needed_excess: float = 20.0  # known models end at 3, backlash at 13, unknown effects above 200
    free_curve_share: float = 0.5  # of a free curve's gain, or an effect only imitates what is missing
    first_error: float = 0.05  # first guess of the model error, relative to the torque's rms
    error_rounds: int = 6  # in which the model error is adapted to the residual
    error_settled: float = 0.25  # |log χ²| of every joint at which it is
    effects: int = 14  # at most
    refused: int = 9  # candidates refused in a row that end the search
    batch: int = 3  # candidates refitted before the best of them is taken
    least_score: float = 10.0
    stretch: float = 0.5  # [s] stretches over which the improvement's standard error is estimated
    deviations: float = 2.0  # standard errors of the held-out improvement
    least_improvement: float = 0.02  # of one joint's held-out variance
    iterations: int = 5
    start_iterations: int = 8


@dataclass(frozen=True)
class EvidenceThresholds:
    """What is reported of a finding beside its values."""

    tied_gain: float = 20.0  # difference of the objective up to which two effects fit equally well
    tied_share: float = 0.02  # the same as a share of the gain: laws are approximate
    tied_correlation: float = 0.98  # of signatures: ties a candidate that was not refitted
    absorbed_deviations: float = 4.0  # standard errors by which a parameter moved that had absorbed an effect
    absorbed_share: float = 0.01  # and share of its value
    absorbed_parameters: int = 6  # reported at most
    telling_density: float = 1.5  # times the average difference of two signatures, in a motion worth naming
    telling_samples: float = 0.02  # share of the samples that such a motion has to have
    # no finding is stated as surer: of those stated highest, no more are right in the study
    # (`python -m benchmarks.diagnosis_study calibrate`)
    most_sure: float = 0.99
    final_refit_chi: float = 1.5  # growth of χ² at which the final refit is discarded: traces weigh too much


@dataclass(frozen=True)
class BandwidthThresholds:
    """What counts as moving with the observer's bandwidth; `tests/test_guard.py` holds it to known cases."""

    deviations: float = 3.0  # standard errors of the difference between two fits of the same data
    change: float = 1.0  # times the noise by which the residual has to change
    change_share: float = 0.1  # and share of the residual


@dataclass(frozen=True)
class Thresholds:
    """All decision thresholds of the diagnosis."""

    acceptance: AcceptanceThresholds = AcceptanceThresholds()
    search: SearchThresholds = SearchThresholds()
    model_error: ModelErrorThresholds = ModelErrorThresholds()
    evidence: EvidenceThresholds = EvidenceThresholds()
    bandwidth: BandwidthThresholds = BandwidthThresholds()


THRESHOLDS = Thresholds()
