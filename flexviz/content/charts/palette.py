"""Colour-blind safe colours: Okabe–Ito for categories, cividis for magnitudes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Palette:
    """Hexadecimal colours of the Okabe–Ito set by meaning.

    Attributes:
        playhead: playback time and highlighted data.
        beside: a second model, compared with the first.
        series: for numbered lines.
        body: RGB of a link that has no residual yet.
    """

    measured: str = "#0072B2"
    model: str = "#E69F00"
    playhead: str = "#D55E00"
    residual: str = "#009E73"
    torque: str = "#CC79A7"
    deflection: str = "#56B4E9"
    beside: str = "#009E73"
    reference: str = "#7b7b7b"
    series: tuple[str, ...] = (
        "#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#F0E442", "#999999",
    )  # fmt: skip
    body: tuple[int, int, int] = (176, 184, 192)


COLOURS = Palette()

# Nine evenly spaced points of the cividis map.
_CIVIDIS = np.array(
    [
        (0, 34, 78), (24, 54, 109), (62, 76, 107), (90, 98, 111), (117, 120, 117),
        (147, 144, 115), (181, 171, 105), (218, 199, 84), (254, 232, 56),
    ],
    dtype=float,
)  # fmt: skip


def cividis(share: float) -> tuple[int, int, int]:
    """RGB 0–255 at `share` in [0, 1] of the cividis map; grey for NaN."""
    if not np.isfinite(share):
        return COLOURS.body
    at = float(np.clip(share, 0.0, 1.0)) * (len(_CIVIDIS) - 1)
    low = min(int(at), len(_CIVIDIS) - 2)
    rgb = _CIVIDIS[low] + (at - low) * (_CIVIDIS[low + 1] - _CIVIDIS[low])
    red, green, blue = (round(float(value)) for value in rgb)
    return red, green, blue


def rgb(hexadecimal: str) -> tuple[int, int, int]:
    """ "#0072B2" as RGB 0–255."""
    return int(hexadecimal[1:3], 16), int(hexadecimal[3:5], 16), int(hexadecimal[5:7], 16)


def css(colour: tuple[int, int, int]) -> str:
    """A colour as CSS text."""
    return "#{:02x}{:02x}{:02x}".format(*colour)


def gradient(steps: int = 9) -> str:
    """The cividis map as a CSS gradient, left to right."""
    stops = ", ".join(css(cividis(i / (steps - 1))) for i in range(steps))
    return f"linear-gradient(to right, {stops})"
