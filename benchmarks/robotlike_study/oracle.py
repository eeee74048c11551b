"""The diagnosis beside a fit that is given the hidden effects of the library, started from their true values.

That fit is made twice, weighted by the sensors' noise and by its own residual in the band of the motion, as
the diagnosis fits sets with few and with many effects; the better of the two in the held-out groups counts.
It lacks laws of no library, for which its parameters stand in as far as they can. Where the diagnosis ends
with a free curve for such a law, the error is also stated of that fit with the same curve, fitted together
with everything else.
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
from flexviz.diagnosis import FitContext, diagnose
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
        with_curve: of that fit with the free curves of the diagnosis; None if it has none.
        laws: number of hidden laws of no library.
    """

    name: str
    found: float
    oracle: float
    with_curve: float | None
    laws: int

    def text(self) -> str:
        """One line."""

        def given(what: str, error: float) -> str:
            return f", given {what} {100 * error:.3f} % (×{self.found / error:.3f})"

        laws = f" ({self.laws} hidden law(s) of no library)" if self.laws else ""
        curve = "" if self.with_curve is None else given("these and the free curve", self.with_curve)
        found = f"{100 * self.found:.3f} % of the torque"
        return f"{self.name}{laws}: {found}{given('the effects', self.oracle)}{curve}"


def compare_all(work: Path, only: str) -> Iterator[Compared]:
    """Each set in turn."""
    for name in made_cases(work, only):
        truth = json.loads(truth_file(work, name).read_text(encoding="utf-8"))
        measurements = read_set(case_folder(work, name))
        result, plain = diagnose(measurements, apply=True), identify(measurements).model
        laws = sum(e["effect"] == UNKNOWN for e in truth["effects"])
        assert result.model is not None
        curves = [e for e in result.model.effects if free_curve(e.effect) is not None]
        with_curve = _least(measurements, plain, truth, curves) if curves else None
        found = _norm(measurements, result.model)
        yield Compared(name, found, _least(measurements, plain, truth, []), with_curve, laws)


def _least(measurements: MeasurementSet, plain: FlexibleModel, truth: Json, more: list[EffectValue]) -> float:
    """The smaller error of both fits with the hidden effects, and with more that start from given values."""
    return min(_norm(measurements, model) for model in _given(measurements, plain, truth, more))


def _norm(measurements: MeasurementSet, model: FlexibleModel) -> float:
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
