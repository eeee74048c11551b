"""Notes that accompany a verdict, and held-out groups that judge nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.fit_context import Fit
from flexviz.analysis.diagnosis.prediction_errors import PredictionErrors
from flexviz.analysis.motion import MOTION, Phase, Phases
from flexviz.content.records import FreeCurve, Note, NoteKind
from flexviz.content.results import BandwidthCheck
from flexviz.content.wording import JointErrors, left_text, listed, plural, stated_errors
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
) -> tuple[Note, ...]:
    """Notes on a diagnosis.

    Args:
        final, verdict, errors: the final model, the verdict on it, and its residuals.
        model_error_variance: shape (n,) [Nm²], allowed in the search; None if there was none.
        curve: free curve of the unexplained residual.
        bandwidths: result of the bandwidth check.
    """
    out: list[tuple[NoteKind, str]] = []
    joints = final.layout.joints
    if model_error_variance is not None:
        left = JointErrors(np.sqrt(model_error_variance).tolist(), errors.spread, (), errors.units)
        sizes = ", ".join(f"{joint} {left.whole(j)}" for j, joint in enumerate(joints))
        text = (
            "no model reaches the noise, so an effect was added only if it also predicts the held-out "
            "groups better"
        )
        out.append(("model-error", f"{text}; torque error left in the model: {sizes}"))
    floor, rms = np.maximum(errors.noise_floor, 1e-300), np.array(errors.stated)
    largest = np.maximum(rms, errors.rms)
    j = int(np.argmax(largest / floor))
    pulses = any(weighting.unknown for weighting in final.point.weightings)
    if verdict == "nothing-missing" and pulses and largest[j] > MOTION.outlier * floor[j]:
        kind = "fitted" if largest[j] > rms[j] or errors.rms_validation is None else "held-out"
        said = JointErrors(largest.tolist(), errors.spread, (), errors.units).whole(j)
        text = (
            f"the error of {joints[j]}, {said} in the {kind} groups, arises at motion "
            "reversals and backlash crossings: it includes their unknown torque, which the fit treats as "
            "pulses of unknown size"
        )
        out.append(("pulses", text))
    if verdict == "unknown":
        told = stated_errors(errors, errors.spread)
        out.append(("unexplained", f"unexplained residual: {left_text(joints, told)}"))
    if curve is not None and curve.certain:
        sides = " and the direction of motion" if len(curve.directions) > 1 else ""
        text = (
            f"a free curve against the {curve.variable}{sides} of {curve.joint} explains "
            f"{100 * max(curve.explained, 0.0):.0f} % of its residual: not physics"
        )
        out.append(("free-curve", text + (f"; its form is that of {curve.form}" if curve.form else "")))
    if own := ", ".join(e.text(joints) for e in final.layout.effects if EFFECTS[e.effect].stopgap):
        text = f"not physics, but in the model: {own}; it stands for a law that is still unknown"
        out.append(("stopgap", text))
    for text in bandwidths.texts() if bandwidths is not None else ():
        out.append(("bandwidth", text))
    return tuple(Note(kind, text) for kind, text in out)


def standstill_text(joints: Sequence[str], first_phase: Phases) -> str:
    """Which samples do not count; `first_phase`, shape (n,): the first phase of each joint that does."""

    def named(some: list[str]) -> str:
        return "all joints" if len(some) == len(joints) > 1 else listed(some)

    still = [j for j, first in zip(joints, first_phase, strict=True) if first]
    starts = [j for j, first in zip(joints, first_phase, strict=True) if first == Phase.MOTION]
    after = f"{STILL.start_angle:g} rad after it"
    also = "" if not starts else f" and the first {after}"
    also += f" ({named(starts)})" if starts and starts != still else ""
    return (
        f"standstill of {named(still)}{also} counts in no error: static friction can take any value up to "
        "its limit there"
    )


def without_still_groups(measurements: MeasurementSet) -> tuple[MeasurementSet, list[Note]]:
    """The set without held-out groups that stand still, and a note about them.

    At rest friction takes any value up to its limit: there, a model with the right friction predicts no
    better than one without.
    """

    def moved(group: Group) -> Array:
        """Range of each motor's position, shape (n,) [rad]."""
        return np.ptp(np.concatenate([s.theta for s in group.segments]), axis=0)

    fitted, _ = measurements.select()
    least = STILL.still * np.max([moved(group) for group in fitted], axis=0)
    still = [group.name for group in measurements.validation_groups if np.all(moved(group) < least)]
    if not still:
        return measurements, []
    text = (
        f"held-out {plural(len(still), 'group')} {listed(still)} counts in no error: the robot stands "
        "still, where static friction can take any value up to its limit"
    )
    kept = tuple(group for group in measurements.groups if group.name not in still)
    return replace(measurements, groups=kept), [Note("other", text)]
