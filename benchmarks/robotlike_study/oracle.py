"""The diagnosis beside a fit that is given the hidden effects of the library, started from their true values.

That fit is made twice, weighted by the sensors' noise and by its own residual in the band of the motion, as
the diagnosis fits sets with few and with many effects; the better of the two in the held-out groups counts.
It lacks laws of no library, for which its parameters stand in as far as they can. The diagnosis determines
them beside such a law and offers a free curve for it: both errors are also stated with that curve, fitted
together with everything else.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.diagnosis_study.making import case_folder, truth_file
from benchmarks.diagnosis_study.oracle import chosen, errors, with_hidden
from benchmarks.robotlike_study.judging import UNKNOWN
from benchmarks.robotlike_study.running import made_cases
from flexviz.diagnosis import FitContext, diagnose, why_no_curve, with_free_curve
from flexviz.diagnosis.motion_fit import MotionContext
from flexviz.effects import choose_effects, free_curve
from flexviz.equation import Layout
from flexviz.identification import identify
from flexviz.measurements import MeasurementSet, read_set
from flexviz.model import EffectValue, FlexibleModel

Json = dict[str, Any]

ITERATIONS = 40


@dataclass(frozen=True)
class Compared:
    """Held-out errors of one set: norm over the joints of the rms, each relative to its torque's spread.

    Attributes:
        found: of the last model of the diagnosis.
        oracle: of the fit that is given the hidden effects.
        with_curve: both with the free curve that the diagnosis offers; None unless it ends with "unknown".
        laws: number of hidden laws of no library.
    """

    name: str
    found: float
    oracle: float
    with_curve: tuple[float, float] | None
    laws: int

    def text(self) -> str:
        """One line."""

        def stated(found: float, oracle: float) -> str:
            ratio = found / oracle
            return f"{100 * found:.3f} % of the torque, given the effects {100 * oracle:.3f} % (×{ratio:.3f})"

        laws = f" ({self.laws} hidden law(s) of no library)" if self.laws else ""
        curve = "" if self.with_curve is None else f"; with the free curve {stated(*self.with_curve)}"
        return f"{self.name}{laws}: {stated(self.found, self.oracle)}{curve}"


def compare_all(work: Path, only: str) -> Iterator[Compared]:
    """Each set in turn."""
    for name in made_cases(work, only):
        truth = json.loads(truth_file(work, name).read_text(encoding="utf-8"))
        measurements = read_set(case_folder(work, name))
        result, plain = diagnose(measurements, apply=True), identify(measurements).model
        laws = sum(e["effect"] == UNKNOWN for e in truth["effects"])
        both = None
        if not why_no_curve(result):
            more = with_free_curve(measurements, result)
            curve = [e for e in more.model.effects if free_curve(e.effect)] if more.model else []
            both = _norm(measurements, more.model), _least(measurements, plain, truth, curve)
        found = _norm(measurements, result.model)
        yield Compared(name, found, _least(measurements, plain, truth, []), both, laws)


def _least(measurements: MeasurementSet, plain: FlexibleModel, truth: Json, more: list[EffectValue]) -> float:
    """The smaller error of both fits with the hidden effects, and with more that start from given values."""
    return min(_norm(measurements, model) for model in _given(measurements, plain, truth, more))


def _norm(measurements: MeasurementSet, model: FlexibleModel | None) -> float:
    assert model is not None
    return float(np.linalg.norm(np.array(errors(measurements, model)) / measurements.torque_spread))


def _given(
    measurements: MeasurementSet, plain: FlexibleModel, truth: Json, more: list[EffectValue]
) -> Iterator[FlexibleModel]:
    joints = measurements.joints
    known = [e for e in truth["effects"] if e["effect"] != UNKNOWN]
    hidden = [*(EffectValue(e["effect"], e["joint"], e["parameters"]) for e in known), *more]
    start = replace(
        plain,
        stiffness=np.array(truth["stiffness"]),
        motor_inertia=np.array(truth["motor_inertia"]),
        effects=(*plain.effects, *hidden),
    )
    base = Layout(joints, choose_effects(measurements.effects, joints))
    layout = with_hidden(base, [chosen(e, joints) for e in hidden])
    x = layout.vector(start)
    by_noise = FitContext(measurements, layout).fit(layout, x, iterations=ITERATIONS)
    by_residual = MotionContext(measurements, joints).fit(layout, x, iterations=ITERATIONS)
    for fit in (by_noise, by_residual):
        yield layout.model(fit.x)
