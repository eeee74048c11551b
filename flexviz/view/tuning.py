"""What an observer's tuning costs: residual and noise floor of every joint, the trade, the ESO's poles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.arrays import Array
from flexviz.charts import COLOURS, DASHED, Chart, ChartAxis, ChartSeries, no_chart, thin
from flexviz.identification import ObservedResidual
from flexviz.wording import escape, number

SPARK_WIDTH, SPARK_HEIGHT, SPARK_POINTS = 140, 40, 100  # [px], [px], samples drawn
NOISE_BAND = 2.0  # noise floors: 95 % of the noise
POLES_WIDTH, POLES_HEIGHT = 290, 160  # [px]
TRADE_HEIGHT = 170  # [px]
SAME_POLE = 5e-3  # distance relative to the farthest, below which poles are listed as one


@dataclass(frozen=True, eq=False)
class Cost:
    """Rms residual and noise floor (n,) [Nm]."""

    rms: Array
    noise_floor: Array


def residuals_html(
    found: ObservedResidual, joints: Sequence[str], chosen: int, largest: Sequence[float] = ()
) -> str:
    """Small multiples: the residual of every joint over time, with the band that noise alone would fill.

    `largest` [Nm], one per joint, is what their axes have to hold besides.
    """
    ends = largest or (0.0,) * len(joints)
    cards = [
        f'<div class="fv-multiple{" fv-chosen" if j == chosen else ""}">'
        f"<div><span>{escape(name)}</span> <b>{ratio(found.rms[j], found.noise_floor[j])}</b></div>"
        f"{spark_svg(found.time, found.residual[:, j], float(found.noise_floor[j]), ends[j])}"
        f'<div class="fv-dim">{number(float(found.rms[j]), 3)} / {number(float(found.noise_floor[j]), 3)} Nm'
        "</div></div>"
        for j, name in enumerate(joints)
    ]
    return f'<div class="fv fv-multiples">{"".join(cards)}</div>'


def ratio(rms: float, floor: float) -> str:
    """The rms residual in units of the noise floor."""
    return f"{number(rms / floor, 2)} × floor" if floor > 0 else "no noise"


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
            ChartSeries("noise floor", COLOURS.reference, w, np.maximum(floor, 1e-12), 1.6, DASHED),
        ),
        marker=present,
        marked="present",
        height=TRADE_HEIGHT,
    )


def decades(low: float, high: float) -> tuple[float, float]:
    """The powers of ten around two positive values."""
    return 10.0 ** np.floor(np.log10(low)), 10.0 ** np.ceil(np.log10(high))


def poles_html(theta: NDArray[np.complex128], tau: NDArray[np.complex128]) -> str:
    """The observer's poles in the complex plane, and as a list."""
    listed = [f"<b>Poles</b> of θ: {poles_text(theta)}"]
    same = np.allclose(np.sort_complex(theta), np.sort_complex(tau), rtol=1e-9)
    listed.append("of τ: the same" if same else f"of τ: {poles_text(tau)}")
    return f'<div class="fv">{_poles_svg(theta, tau)}<div>{"; ".join(listed)} rad/s</div></div>'


def poles_text(poles: NDArray[np.complex128]) -> str:
    """Real poles and conjugate pairs, slowest first, with how often they occur."""
    near = SAME_POLE * float(np.abs(poles).max())
    kinds: list[tuple[complex, int]] = []
    for pole in sorted((p for p in poles if p.imag > -near), key=lambda p: (-p.real, p.imag)):
        if kinds and abs(kinds[-1][0] - pole) < near:
            kinds[-1] = kinds[-1][0], kinds[-1][1] + 1
        else:
            kinds.append((pole, 1))
    texts = []
    for pole, count in kinds:
        pair = f" ± {number(pole.imag, 3)}i" if pole.imag > near else ""
        texts.append(f"{number(pole.real, 3)}{pair}" + (f" ({count} times)" if count > 1 else ""))
    return ", ".join(texts)


def _poles_svg(theta: NDArray[np.complex128], tau: NDArray[np.complex128]) -> str:
    """Crosses for θ and rings for τ; the unstable half-plane is hatched."""
    both = np.concatenate((theta, tau))
    radius = float(np.abs(theta).prod() ** (1 / len(theta)))
    left = 1.2 * max(float(-both.real.min()), radius)
    right = max(1.3 * float(both.real.max()), 0.25 * left)
    scale = min(POLES_WIDTH / (left + right), POLES_HEIGHT / (2.3 * max(float(both.imag.max()), radius)))
    zero_x, zero_y = POLES_WIDTH - scale * right, POLES_HEIGHT / 2
    ink = "var(--mantine-color-text)"
    parts = [
        f'<svg class="fv-poles" viewBox="0 0 {POLES_WIDTH} {POLES_HEIGHT}" role="img" font-size="11" '
        f'fill="{ink}"><title>Poles of θ {escape(poles_text(theta))} rad/s</title>'
        f'<rect x="0" y="0" width="{zero_x:.1f}" height="{POLES_HEIGHT}" fill="{COLOURS.residual}" '
        'fill-opacity="0.10"/>'
        f'<rect x="{zero_x:.1f}" y="0" width="{POLES_WIDTH - zero_x:.1f}" height="{POLES_HEIGHT}" '
        f'fill="{COLOURS.playhead}" fill-opacity="0.18"/>'
        f'<path d="M0 {zero_y}H{POLES_WIDTH}M{zero_x:.1f} 0V{POLES_HEIGHT}" stroke="{ink}" '
        'stroke-width="0.8" opacity="0.6"/>'
        f'<circle cx="{zero_x:.1f}" cy="{zero_y}" r="{scale * radius:.1f}" fill="none" stroke="{ink}" '
        'stroke-dasharray="3 3" opacity="0.5"/>'
        f'<text x="5" y="13">stable</text>'
        f'<text x="{POLES_WIDTH - 3}" y="13" text-anchor="end">unstable</text>'
        f'<text x="{zero_x - scale * radius:.1f}" y="{zero_y + 20}" text-anchor="middle" opacity="0.8">'
        f"−{number(radius, 3)}</text>"
    ]
    for poles, colour, ring in ((theta, COLOURS.measured, False), (tau, COLOURS.model, True)):
        for pole in poles:
            x, y = zero_x + scale * pole.real, zero_y - scale * pole.imag
            shape = (
                f'<circle cx="{x:.1f}" cy="{y:.1f}" r="6.5" fill="none"'
                if ring
                else f'<path d="M{x - 4:.1f} {y - 4:.1f}l8 8m0 -8l-8 8"'
            )
            parts.append(f'{shape} stroke="{colour}" stroke-width="2"/>')
    key = POLES_HEIGHT - 6
    parts.append(
        f'<text x="5" y="{key}" fill="{COLOURS.measured}">× θ</text>'
        f'<text x="34" y="{key}" fill="{COLOURS.model}">○ τ</text></svg>'
    )
    return "".join(parts)
