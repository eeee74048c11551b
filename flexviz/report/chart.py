"""A chart as data: lines and bands over one common plane, with what it says in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Curve:
    """One line: x and y of shape (N,); NaN interrupts it.

    Attributes
    ----------
    label: in the legend; empty for none.
    colour: hexadecimal, of the Okabe-Ito colours.
    dash: "" or an SVG dash pattern, so that lines are told apart without colour.
    marks: a dot at every point.
    """

    x: Array
    y: Array
    label: str
    colour: str
    dash: str = ""
    width: float = 1.8
    marks: bool = False


@dataclass(frozen=True, eq=False)
class Band:
    """What lies between low and high, each of shape (N,) at x."""

    x: Array
    low: Array
    high: Array
    label: str
    colour: str


@dataclass(frozen=True, eq=False)
class Chart:
    """One chart.

    Attributes
    ----------
    title: what it shows; also its accessible name.
    description: the same in sentences, for those who cannot see it.
    x_label, y_label: the axes with their units.
    curves, bands: what is drawn; bands below.
    logarithmic: a logarithmic ordinate, of positive values.
    x_ticks: (value, text) where x are not numbers; None where they are.
    span: an interval of x that is highlighted, or None.
    """

    title: str
    description: str
    x_label: str
    y_label: str
    curves: tuple[Curve, ...]
    bands: tuple[Band, ...] = ()
    logarithmic: bool = False
    x_ticks: tuple[tuple[float, str], ...] | None = None
    span: tuple[float, float] | None = None
    height: int = 260


def limits(values: Sequence[Array], share: float = 0.04) -> tuple[float, float]:
    """The smallest and the largest finite value with a margin; never an empty interval."""
    found = np.concatenate([np.ravel(v) for v in values]) if values else np.zeros(0)
    found = found[np.isfinite(found)]
    low, high = (float(found.min()), float(found.max())) if found.size else (0.0, 1.0)
    margin = share * (high - low) or max(abs(low), 1.0) * 0.1
    return low - margin, high + margin
