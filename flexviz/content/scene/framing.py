"""The camera that shows given points as large as the free part of a canvas allows."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from flexviz.base.arrays import Array

FIELD_OF_VIEW = np.radians(50.0)  # vertical
MARGIN = 0.05  # of the free part, at each side
LEAST_FREE = 0.2  # share of the canvas's width and height below which a part is too small to use


class Box(NamedTuple):
    """A rectangle [pixels], from the canvas's upper left corner."""

    left: float
    top: float
    right: float
    bottom: float


@dataclass(frozen=True)
class Screen:
    """A canvas, and what lies over it."""

    width: float  # [pixels]
    height: float  # [pixels]
    covered: tuple[Box, ...] = ()

    def free(self) -> list[Box]:
        """Rectangles of the canvas that nothing covers; the whole canvas if all of them are too small."""
        whole = Box(0.0, 0.0, self.width, self.height)
        found = []
        for sides in product(range(4), repeat=len(self.covered)):
            left, top, right, bottom = whole
            for side, box in zip(sides, self.covered, strict=True):
                left = max(left, box.right) if side == 0 else left
                top = max(top, box.bottom) if side == 1 else top
                right = min(right, box.left) if side == 2 else right
                bottom = min(bottom, box.top) if side == 3 else bottom
            if right - left >= LEAST_FREE * self.width and bottom - top >= LEAST_FREE * self.height:
                found.append(Box(left, top, right, bottom))
        return list(dict.fromkeys(found)) or [whole]


def framing(points: Array, towards: Array, screen: Screen, below: float = 0.0) -> tuple[Array, Array]:
    """Camera position and target (3,) [m] that show all points (P, 3) [m] as large as the screen allows.

    The camera looks against `towards` (3,), upright. In coordinates (r, u, f) to the right, up and forward a
    point lies in the picture where lo ≤ (r − r₀)/(f − f₀) ≤ hi; lo and hi are the slopes to the sides of the
    free part. Hence r₀ − hi f₀ ≥ max(r − hi f) and r₀ − lo f₀ ≤ min(r − lo f), and the largest such f₀ is the
    nearest camera; the same for u. `below` [pixels] stay free under the points, for labels.
    """
    forward = -towards / np.linalg.norm(towards)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(right, forward), forward])
    across, high, deep = axes @ points.T
    slope = 2.0 * np.tan(FIELD_OF_VIEW / 2) / screen.height  # of one pixel
    best = np.array([0.0, 0.0, -np.inf])
    middle = np.array([screen.width, screen.height]) / 2
    for box in screen.free():
        wide, tall = box.right - box.left, box.bottom - box.top
        low_r, high_r = slope * (
            np.array([box.left, box.right]) + MARGIN * wide * np.array([1, -1]) - middle[0]
        )
        floor = box.bottom - min(MARGIN * tall + below, tall / 2)
        low_u, high_u = slope * (middle[1] - np.array([floor, box.top + MARGIN * tall]))
        sides = [(across, low_r, high_r), (high, low_u, high_u)]
        limits = [(np.max(x - hi * deep), np.min(x - lo * deep), lo, hi) for x, lo, hi in sides]
        nearest = min((last - first) / (hi - lo) for first, last, lo, hi in limits)
        if nearest > best[2]:
            best = np.array([*((a + b + (lo + hi) * nearest) / 2 for a, b, lo, hi in limits), nearest])
    reach = float(np.mean(deep)) - best[2]
    position = best @ axes
    return position, position + reach * forward
