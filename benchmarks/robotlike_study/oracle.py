"""The diagnosis beside a fit that is given the hidden effects of the library, started from their true values.

That fit is made twice, weighted by the sensors' noise and by its own residual in the band of the motion, as
the diagnosis fits sets with few and with many effects; the better of the two in the held-out groups counts.
It lacks unmodelled torques, for which its parameters stand in as far as they can. Where the diagnosis ends
with a free curve for such a law, the error is also stated of that fit with the same curve, fitted together
with everything else.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.diagnosis_study.judging import UNKNOWN
from benchmarks.diagnosis_study.oracle import chosen, errors, with_hidden
from benchmarks.running import Json, case_folder, made_cases, read, truth_file
from flexviz.analysis.diagnosis import FitContext, diagnose
from flexviz.analysis.identification import identify
from flexviz.analysis.motion import MotionContext
from flexviz.data.measurements import MeasurementSet, read_set
from flexviz.model.effects import choose_effects, free_curve
from flexviz.model.equation import Layout
from flexviz.robot.model import EffectValue, FlexibleModel

ITERATIONS = 40


def compared(work: Path, only: str) -> Iterator[str]:
    """A line for each set: norms over the joints of the held-out rms relative to the torque's spread."""
    for name in made_cases(work, only):
        truth, measurements = read(truth_file(work, name)), read_set(case_folder(work, name))
        result, plain = diagnose(measurements, apply=True), identify(measurements, refine=False).model
        assert result.model is not None
        found = _norm(measurements, result.model)

        def given(what: str, more: list[EffectValue]) -> str:
            error = _least(measurements, plain, truth, more)  # noqa: B023
            return f", given {what} {100 * error:.3f} % (×{found / error:.3f})"  # noqa: B023

        laws = sum(e["effect"] == UNKNOWN for e in truth["effects"])
        curves = [e for e in result.model.effects if free_curve(e.effect) is not None]
        unmodelled = f" ({laws} hidden unmodelled torque(s))" if laws else ""
        line = f"{name}{unmodelled}: {100 * found:.3f} % of the torque"
        line += given("the effects", [])
        yield line + given("these and the free curve", curves) if curves else line


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
