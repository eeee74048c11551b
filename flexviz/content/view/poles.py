"""The poles of the extended-state observer in a picture whose frame stays, and as a list."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexviz.content.charts import COLOURS
from flexviz.content.wording import escape, number

WIDTH, HEIGHT = 290, 200  # [px]
LEFT, RIGHT = -3.2, 0.8  # [w] ends of the picture
SCALE = WIDTH / (RIGHT - LEFT)  # [px/w]
INSET = 9.0  # [px] from the edge, where a pole beyond it is drawn
SAME_POLE = 5e-3  # distance relative to the farthest, below which poles are listed as one
SIGNALS = ("θ", "τ")

Poles = NDArray[np.complex128]


def pole_at(x: float, y: float, bandwidth: float) -> complex:
    """The pole [rad/s] at a place [px] of the picture."""
    return bandwidth * complex(LEFT + x / SCALE, (HEIGHT / 2 - y) / SCALE)


def place_of(pole: complex, bandwidth: float) -> tuple[float, float]:
    """The place [px] of a pole [rad/s], at the edge if it lies beyond."""
    x, y = SCALE * (pole.real / bandwidth - LEFT), HEIGHT / 2 - SCALE * pole.imag / bandwidth
    return min(max(x, INSET), WIDTH - INSET), min(max(y, INSET), HEIGHT - INSET)


def poles_html(theta: Poles, tau: Poles, bandwidth: float) -> str:
    """The poles [rad/s] around −w, w the `bandwidth` [rad/s]; those of τ where they differ."""
    listed = [f"<b>Poles</b> of θ: {poles_text(theta)}"]
    same = np.allclose(np.sort_complex(theta), np.sort_complex(tau), rtol=1e-9)
    listed.append("of τ: the same" if same else f"of τ: {poles_text(tau)}")
    picture = _picture((theta,) if same else (theta, tau), bandwidth)
    return f'<div class="fv">{picture}<div>{"; ".join(listed)} rad/s</div></div>'


def poles_text(poles: Poles) -> str:
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


def _picture(kinds: tuple[Poles, ...], bandwidth: float) -> str:
    """Crosses for θ and rings for τ, which the page's script lets drag; the unstable half-plane is tinted."""
    zero, middle = place_of(0j, bandwidth)
    ink = "var(--fv-text)"
    parts = [
        f'<svg class="fv-poles" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" font-size="11" fill="{ink}">'
        f"<title>Poles of θ {escape(poles_text(kinds[0]))} rad/s; drag one</title>"
        f'<rect x="0" y="0" width="{zero:.1f}" height="{HEIGHT}" fill="{COLOURS.residual}" '
        f'fill-opacity="0.10"/><rect x="{zero:.1f}" y="0" width="{WIDTH - zero:.1f}" height="{HEIGHT}" '
        f'fill="{COLOURS.playhead}" fill-opacity="0.18"/>'
        f'<path d="M0 {middle}H{WIDTH}M{zero:.1f} 0V{HEIGHT}" stroke="{ink}" stroke-width="0.8" '
        'opacity="0.6"/>'
        f'<circle cx="{zero:.1f}" cy="{middle}" r="{SCALE:.1f}" fill="none" stroke="{ink}" '
        'stroke-dasharray="3 3" opacity="0.5"/>'
        '<text x="5" y="13">stable</text>'
        f'<text x="{WIDTH - 3}" y="13" text-anchor="end">unstable</text>'
    ]
    for factor in (1, 2, 3):
        x, _ = place_of(complex(-factor * bandwidth), bandwidth)
        parts.append(
            f'<text x="{x:.1f}" y="{middle + 22}" text-anchor="middle" opacity="0.8">'
            f"−{number(factor * bandwidth, 3)}</text>"
        )
    looks = ((COLOURS.measured, False), (COLOURS.model, True))
    for signal, poles, (colour, ring) in zip(SIGNALS, kinds, looks, strict=False):
        for index, pole in enumerate(poles):
            x, y = place_of(pole, bandwidth)
            shape = (
                f'<circle cx="{x:.1f}" cy="{y:.1f}" r="6.5" fill="none"'
                if ring
                else f'<path d="M{x - 4:.1f} {y - 4:.1f}l8 8m0 -8l-8 8"'
            )
            parts.append(
                f'<g data-pole="{signal} {index}">{shape} stroke="{colour}" stroke-width="2"/>'
                f'<circle cx="{x:.1f}" cy="{y:.1f}" r="11" fill="transparent"/></g>'
            )
    key = HEIGHT - 6
    parts.append(
        f'<text x="5" y="{key}" fill="{COLOURS.measured}">× θ{" and τ" if len(kinds) == 1 else ""}</text>'
    )
    if len(kinds) > 1:
        parts.append(f'<text x="34" y="{key}" fill="{COLOURS.model}">○ τ</text>')
    return "".join(parts) + "</svg>"
