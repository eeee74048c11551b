"""Torque of one joint in other coordinates than time: its spectrum, and over the angle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexviz.analysis.identification import Identification
from flexviz.base.arrays import Array
from flexviz.content.charts import COLOURS, Chart, ChartAxis, ChartSeries
from flexviz.content.view.time_charts import model_torque
from flexviz.content.wording import TORQUE_SIGNAL, DrivingSignal
from flexviz.data.measurements import Group

PHASE_POINTS = 500  # per line
LONGEST_WINDOW = 8.0  # [s] of a spectrum
HIGHEST_DRAWN = 40.0  # [Hz]; the observers' bands end far below
LEAST_WRITTEN = 1e-3  # value at an axis; smaller ones are written as 0
LEAST_DENSITY = 1e-6  # of the largest, drawn on a logarithmic axis
HEIGHT = 230  # [px]


def shape_charts(
    group: Group,
    joint: int,
    name: str,
    result: Identification | None,
    signal: DrivingSignal = TORQUE_SIGNAL,
) -> tuple[Chart, ...]:
    """What drives the joint against the motor angle, and the spectra of that and of the residual."""
    longest = max(group.segments, key=len)
    time, theta, tau = longest.time, longest.theta[:, joint], longest.tau[:, joint]
    lines = [("measured", COLOURS.measured, time, tau)]
    model = model_torque(group, joint, result)
    if model is not None:
        inside = (model[0] >= time[0]) & (model[0] <= time[-1])
        if inside.any():  # this segment may have been too short for the observer
            kinds = (("model", COLOURS.model, model[1]), ("residual", COLOURS.residual, model[2]))
            lines += [(label, colour, model[0][inside], values[inside]) for label, colour, values in kinds]
    return _phase(name, time, theta, lines[:2], signal), _spectra(name, lines, signal)


Line = tuple[str, str, Array, Array]  # label, colour, time (N,) [s], torque (N,) [Nm]


def _phase(name: str, time: Array, theta: Array, lines: list[Line], signal: DrivingSignal) -> Chart:
    """Points of torque over angle; friction opens a loop, a spring bends its middle."""
    first, last = max(line[2][0] for line in lines), min(line[2][-1] for line in lines)
    at = np.linspace(first, last, PHASE_POINTS)
    angle = np.interp(at, time, theta)
    order = np.argsort(angle)
    series = tuple(
        ChartSeries(label, colour, angle[order], np.interp(at, when, values)[order], 0.0, points=True)
        for label, colour, when, values in lines
    )
    x, y = ChartAxis("θ", "rad"), ChartAxis(signal.title.lower(), signal.unit)
    return Chart("phase", f"{signal.title} against motor angle, {name}", x, y, series, height=HEIGHT)


def _spectra(name: str, lines: list[Line], signal: DrivingSignal) -> Chart:
    """Amplitude spectral densities on the coarsest of the sampling rates."""
    first, last = max(line[2][0] for line in lines), min(line[2][-1] for line in lines)
    step = max(float(np.median(np.diff(line[2]))) for line in lines)
    at = np.arange(first, last, step)
    series, top = [], 0.0
    for label, colour, when, values in lines:
        width = min(len(at), round(LONGEST_WINDOW / step))
        from scipy.signal import welch  # late: a terminal has no use for it

        hertz, power = welch(np.interp(at, when, values), 1.0 / step, nperseg=width)
        inside = (hertz > 0) & (hertz <= HIGHEST_DRAWN)
        hertz, density = hertz[inside], np.sqrt(power[inside])
        top = max(top, float(density.max(initial=0.0)))
        density = np.maximum(density, LEAST_DENSITY * top or LEAST_DENSITY)
        series.append(ChartSeries(label, colour, hertz, density))
    # the unit is that of the measured torque: the same for every model
    least = LEAST_DENSITY * float(series[0].y.max(initial=0.0))
    factor, prefix = (1.0, "") if least >= LEAST_WRITTEN else (1e3, "m")
    unit = f"{prefix}{signal.unit}/√Hz"
    series = [replace(one, y=factor * one.y) for one in series]
    x, y = ChartAxis("frequency", "Hz"), ChartAxis(signal.title.lower(), unit, logarithmic=True)
    return Chart("spectrum", f"Spectrum of {signal.within}, {name}", x, y, tuple(series), height=HEIGHT)
