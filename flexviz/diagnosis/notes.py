"""What a reader of a diagnosis should know beside the verdict."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.fit_context import Fit
from flexviz.diagnosis.prediction_errors import PredictionErrors
from flexviz.diagnosis.records import BandwidthCheck, FreeCurve
from flexviz.results import Note

SPIKES = 5.0  # times the noise: an rms that needs a word where nothing is missing


def notes(
    final: Fit,
    verdict: str,
    errors: PredictionErrors,
    tolerance: NDArray[np.float64] | None,
    curve: FreeCurve | None,
    watch: BandwidthCheck | None,
) -> tuple[Note, ...]:
    """The sentences.

    Args:
        final: the last model.
        verdict: on it.
        errors: its residuals.
        tolerance: shape (n,) [Nm²], the model error that effects were judged beside; None without.
        curve: for what stays unexplained.
        watch: what moves with the bandwidth.
    """
    out: list[Note] = []
    joints = final.layout.joints
    if tolerance is not None:
        sizes = ", ".join(f"{j} {np.sqrt(t):.3g}" for j, t in zip(joints, tolerance, strict=True))
        text = (
            "no model reaches the measurement noise here: effects were judged by the error of held-out "
            f"groups, beside a model error of (Nm) {sizes}"
        )
        out.append(Note("model-error", text))
    floor = np.maximum(np.array(errors.noise_floor), 1e-300)
    rms = np.array(errors.rms if errors.rms_validation is None else errors.rms_validation)
    largest = np.maximum(rms, errors.rms)
    j = int(np.argmax(largest / floor))
    pulses = any(weighting.basis is not None for weighting in final.point.weightings)
    if verdict == "nothing-missing" and pulses and largest[j] > SPIKES * floor[j]:
        text = (
            f"the error of {joints[j]} ({largest[j]:.3g} Nm) is that of the moments in which joints turn "
            "round or cross a gap: what happens there is fitted as pulses of unknown size, which it holds"
        )
        out.append(Note("pulses", text))
    if verdict == "unknown":
        ratio = rms / floor
        left = ", ".join(
            f"{joints[j]} {rms[j]:.3g} ({ratio[j]:.0f} times the noise)" for j in np.argsort(-ratio)[:3]
        )
        out.append(Note("unexplained", f"what stays unexplained (Nm): {left}"))
    if curve is not None:
        sides = " and the direction of motion" if len(curve.directions) > 1 else ""
        text = (
            f"a free curve against the {curve.variable}{sides} of {curve.joint} would take "
            f"{100 * max(curve.explained, 0.0):.0f} % of its residual: a stopgap, not a model"
        )
        out.append(Note("free-curve", text))
    if watch is not None:
        out += [Note("bandwidth", text) for text in watch.texts()]
    return tuple(out)
