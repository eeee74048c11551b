"""What an observer's tuning costs: the residual of every joint against the smallest one, and the trade."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from flexviz.analysis.identification import ObservedResidual
from flexviz.base.arrays import Array
from flexviz.content.charts import COLOURS, DASHED, Chart, ChartAxis, ChartSeries, no_chart, thin
from flexviz.content.wording import escape, number, quantity, si_scale

SPARK_WIDTH, SPARK_HEIGHT, SPARK_POINTS = 140, 40, 100  # [px], [px], samples drawn
NOISE_BAND = 2.0  # noise floors: 95 % of the noise
MOST_TIMES = 1000.0  # the least residual that is told as a number
TRADE_HEIGHT = 170  # [px]


@dataclass(frozen=True, eq=False)
class Cost:
    """Rms residual and noise floor (n,) [Nm]."""

    rms: Array
    noise_floor: Array


def residuals_html(
    found: ObservedResidual,
    joints: Sequence[str],
    chosen: int,
    largest: Sequence[float] = (),
    least: Sequence[float] = (),
    torque: Sequence[float] = (),
) -> str:
    """Small multiples: the residual of every joint over time, with the band that noise alone would fill.

    Args:
        found: the residual.
        joints: their names.
        chosen: index of the selected joint.
        largest: shape (n,), what their axes have to hold besides [Nm].
        least: shape (n,), the smallest rms residual of any tuning that was tried [Nm]; empty: too few were.
        torque: shape (n,), spread of the recorded torque [Nm].
    """
    ends = largest or (0.0,) * len(joints)
    scores = [
        score(
            found.rms[j],
            least[j] if len(least) else math.nan,
            found.noise_floor[j],
            torque[j] if torque else math.inf,
        )
        for j in range(len(joints))
    ]
    cards = [
        f'<div class="fv-multiple{" fv-chosen" if j == chosen else ""}">'
        f"<div><span>{escape(name)}</span> {scores[j]}</div>"
        f"{spark_svg(found.time, found.residual[:, j], float(found.noise_floor[j]), ends[j])}"
        f'<div class="fv-dim">{pair(float(found.rms[j]), float(found.noise_floor[j]))}</div></div>'
        for j, name in enumerate(joints)
    ]
    return f'<div class="fv fv-multiples">{"".join(cards)}</div>'


def pair(rms: float, floor: float) -> str:
    """ "68.2 / 1.59 mNm": two torques [Nm] with one prefix."""
    factor, unit = si_scale(max(rms, floor), "Nm")
    return f"{number(factor * rms, 3)} / {number(factor * floor, 3)} {unit}"


def score(rms: float, least: float, floor: float, torque: float) -> str:
    """The rms residual against the smallest possible one (HTML); red where the noise exceeds the torque."""
    if floor > torque:
        tip = f"noise {quantity(floor, 'Nm')}, torque {quantity(torque, 'Nm')}"
        return f'<b class="fv-bad" title="{tip}">noise &gt; torque</b>'
    if not (math.isfinite(least) and least > 0):
        return ""
    times = rms / least
    shown = f"{number(times, 3)}" if times < MOST_TIMES else f"> {MOST_TIMES:g}"
    return (
        f'<b title="the smallest of the tunings that were tried: {quantity(least, "Nm")}">{shown} × least</b>'
    )


def spark_svg(time: Array, values: Array, floor: float, end: float = 0.0) -> str:
    """A line without axes, scaled to its largest value or `end`, in front of the band of the noise."""
    x, (y,) = thin(time, [values], SPARK_POINTS)
    largest = max(float(np.abs(y).max(initial=0.0)), NOISE_BAND * floor, end, 1e-300)
    across = SPARK_WIDTH * (x - x[0]) / max(float(x[-1] - x[0]), 1e-12)
    middle = SPARK_HEIGHT / 2
    down = middle * (1 - 0.95 * y / largest)
    half = 0.95 * middle * min(NOISE_BAND * floor / largest, 1.0)
    points = " ".join(["%.1f,%.1f"] * len(x)) % tuple(np.stack((across, down), axis=1).ravel().tolist())
    return (
        f'<svg viewBox="0 0 {SPARK_WIDTH} {SPARK_HEIGHT}" preserveAspectRatio="none" aria-hidden="true">'
        f'<rect x="0" y="{middle - half:.1f}" width="{SPARK_WIDTH}" height="{max(2 * half, 0.6):.1f}" '
        f'fill="{COLOURS.reference}" fill-opacity="0.35"/>'
        f'<polyline points="{points}" fill="none" stroke="{COLOURS.residual}" stroke-width="1.2"/></svg>'
    )


def trade_chart(costs: Mapping[float, Cost], joint: int, name: str, present: float) -> Chart:
    """Rms residual of one joint and its noise floor against bandwidth [rad/s]; the values are kept."""
    if len(costs) < 2:
        return no_chart("trade")
    w = np.array(sorted(costs))
    rms, floor = (np.array([getattr(costs[one], key)[joint] for one in w]) for key in ("rms", "noise_floor"))
    least = max(float(rms.min()), 1e-9)
    return Chart(
        "trade",
        f"What a bandwidth costs, {name}",
        ChartAxis("bandwidth", "rad/s", True, (4.0, 2500.0)),
        ChartAxis(unit="Nm", logarithmic=True, limits=decades(least / 10.0, least * 1e3)),
        (
            ChartSeries("residual", COLOURS.residual, w, np.maximum(rms, 1e-12), 2.0),
            ChartSeries("noise", COLOURS.reference, w, np.maximum(floor, 1e-12), 1.6, DASHED),
        ),
        marker=present,
        marked="present",
        height=TRADE_HEIGHT,
    )


def decades(low: float, high: float) -> tuple[float, float]:
    """The powers of ten around two positive values."""
    return 10.0 ** np.floor(np.log10(low)), 10.0 ** np.ceil(np.log10(high))
