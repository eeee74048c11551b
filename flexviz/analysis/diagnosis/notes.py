"""What accompanies a verdict, and held-out groups that judge nothing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.fit_context import Fit
from flexviz.analysis.diagnosis.prediction_errors import PredictionErrors
from flexviz.analysis.motion import MOTION, Phase, Phases
from flexviz.base.facts import Fact
from flexviz.content.records import FreeCurve, stated_errors
from flexviz.content.results import BandwidthCheck
from flexviz.data.measurements import Group, MeasurementSet
from flexviz.model.effects import EFFECTS

Array = NDArray[np.float64]

STILL = MOTION


def notes(
    final: Fit,
    verdict: str,
    errors: PredictionErrors,
    model_error_variance: Array | None,
    curve: FreeCurve | None,
    bandwidths: BandwidthCheck | None,
) -> Iterator[Fact]:
    """Facts that accompany a diagnosis.

    Args:
        final, verdict, errors: the final model, the verdict on it, and its residuals.
        model_error_variance: shape (n,) [Nm²], allowed in the search; None if there was none.
        curve: free curve of the unexplained residual.
        bandwidths: result of the bandwidth check.
    """
    joints = final.layout.joints
    if model_error_variance is not None:
        left = tuple(np.sqrt(model_error_variance).tolist())
        yield Fact("model-error", joints=joints, values=error_values(left, errors))
    yield from reversal_errors(final, verdict, errors)
    if verdict == "unknown":
        stated = tuple(stated_errors(errors, errors.spread).rms)
        yield Fact("unexplained", joints=joints, values=error_values(stated, errors))
    if curve is not None and curve.certain:
        values = {
            "variable": curve.variable,
            "directions": len(curve.directions),
            "explained": max(curve.explained, 0.0),
            "form": str(curve.form),
        }
        yield Fact("free-curve", joints=(curve.joint,), values=values)
    if own := tuple(e.text(joints) for e in final.layout.effects if EFFECTS[e.effect].stopgap):
        yield Fact("stopgap", values={"effects": own})
    if bandwidths is not None:
        yield from bandwidths.facts()


def error_values(rms: Sequence[float], errors: PredictionErrors) -> dict[str, Any]:
    """Errors of all joints (n,) with what sets them in relation: the torque's spread, and its units."""
    return {"rms": tuple(rms), "spread": tuple(errors.spread), "units": tuple(errors.units)}


def reversal_errors(final: Fit, verdict: str, errors: PredictionErrors) -> Iterator[Fact]:
    """The joint whose error is that of reversals and gap crossings, whose torque is unknown."""
    floor, rms = np.maximum(errors.noise_floor, 1e-300), np.array(errors.stated)
    largest = np.maximum(rms, errors.rms)
    j = int(np.argmax(largest / floor))
    pulses = any(weighting.unknown for weighting in final.point.weightings)
    if verdict == "nothing-missing" and pulses and largest[j] > MOTION.outlier * floor[j]:
        fitted = bool(largest[j] > rms[j]) or errors.rms_validation is None
        values = {name: row[j : j + 1] for name, row in error_values(largest.tolist(), errors).items()}
        yield Fact("pulses", joints=(final.layout.joints[j],), values=values | {"fitted": fitted})


def standstill(joints: Sequence[str], first_phase: Phases) -> Fact:
    """Joints whose rest does not count; `first_phase`, shape (n,): the first phase of each that does."""
    still = tuple(j for j, first in zip(joints, first_phase, strict=True) if first)
    starts = tuple(j for j, first in zip(joints, first_phase, strict=True) if first == Phase.MOTION)
    values = {"of": len(joints), "starts": starts, "start_angle": STILL.start_angle}
    return Fact("standstill", joints=still, values=values)


def without_still_groups(measurements: MeasurementSet) -> tuple[MeasurementSet, list[Fact]]:
    """The set without held-out groups that stand still, and a fact about them.

    At rest friction takes any value up to its limit: there, a model with the right friction predicts no
    better than one without.
    """

    def moved(group: Group) -> Array:
        """Range of each motor's position, shape (n,) [rad]."""
        return np.ptp(np.concatenate([s.theta for s in group.segments]), axis=0)

    fitted, _ = measurements.select()
    least = STILL.still * np.max([moved(group) for group in fitted], axis=0)
    still = tuple(group.name for group in measurements.validation_groups if np.all(moved(group) < least))
    if not still:
        return measurements, []
    kept = tuple(group for group in measurements.groups if group.name not in still)
    return replace(measurements, groups=kept), [Fact("groups-at-rest", "odd", groups=still)]
