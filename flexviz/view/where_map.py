"""The map of all joints: the share of each joint's residual that each variable explains, out of sample."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flexviz.view.colours import cividis, css
from flexviz.view.text import escape, short_names
from flexviz.view.where import VARIABLES, samples

if TYPE_CHECKING:
    from flexviz.identification import Identification

COLUMNS = (*VARIABLES, "group")
SHORT = {"position": "posit.", "velocity": "veloc.", "acceleration": "accel."}
MOST = 20_000  # samples used
BINS = 24
BLOCKS = 40  # stretches of time in a group

Array = NDArray[np.float64]
Shares = dict[tuple[int, str], float]


def shares(result: Identification | None, joints: int) -> Shares:
    """(joint, variable) -> share of the mean square, 0 where nothing is explained; empty without a result."""
    found: Shares = {}
    for joint in range(joints):
        data = samples(result, joint)
        if data is None:
            return {}
        every = -(-len(data.residual) // MOST)
        group, residual = data.group[::every], data.residual[::every]
        block = blocks(group)
        for name in COLUMNS:
            if name == "group":
                index = group
            elif name == "time":
                index = block // 2  # neighbours predict each other
            else:
                values = data.variables[name][::every]
                edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, BINS + 1)))
                index = np.searchsorted(edges[1:-1], values, side="right")
            found[joint, name] = explained(index, residual, block % 2 == 0)
    return found


def blocks(group: NDArray[np.int64]) -> NDArray[np.int64]:
    """(N,) number of the stretch of time that each sample lies in, `BLOCKS` a group."""
    number = np.zeros(len(group), dtype=np.int64)
    for index in np.unique(group):
        rows = group == index
        number[rows] = BLOCKS * index + np.arange(np.count_nonzero(rows)) * BLOCKS // np.count_nonzero(rows)
    return number


def explained(index: NDArray[np.int64], residual: Array, half: NDArray[np.bool_]) -> float:
    """Share of the mean square of a residual (N,) that its means in bins (N,) predict on the other half."""
    bins = int(index.max()) + 1
    product = 0.0
    for train in (half, ~half):
        count = np.bincount(index[train], minlength=bins)
        mean = np.bincount(index[train], residual[train], bins) / np.maximum(count, 1)
        product += float(mean[index[~train]] @ residual[~train])
    return max(product / max(float(residual @ residual), 1e-300), 0.0)


def map_html(found: Shares, joints: Sequence[str], chosen: int = 0) -> str:
    """The map as a table in the colours of the scene, with the numbers in it."""
    if not found:
        return ""
    head = "".join(f'<th title="{name}">{SHORT.get(name, name)}</th>' for name in COLUMNS)
    rows = []
    for index, (joint, short) in enumerate(zip(joints, short_names(tuple(joints)), strict=True)):
        cells = "".join(_cell(found.get((index, name)), joint, name) for name in COLUMNS)
        label = f"<b>{escape(short)}</b>" if index == chosen else escape(short)
        rows.append(f"<tr><td>{label}</td>{cells}</tr>")
    return (
        '<div class="fv"><b>Share of the residual that each variable explains</b>'
        f'<table class="fv-table fv-heat"><tr><th></th>{head}</tr>{"".join(rows)}</table>'
        '<div class="fv-dim">Of the present model, out of sample: noise scores 0.</div></div>'
    )


def _cell(share: float | None, joint: str, variable: str) -> str:
    if share is None:
        return "<td>–</td>"
    colour = cividis(share)
    ink = "#000" if sum(colour) > 330 else "#fff"
    return (
        f'<td style="background:{css(colour)};color:{ink}" title="{escape(joint)}, {escape(variable)}">'
        f"{100 * share:.0f} %</td>"
    )
