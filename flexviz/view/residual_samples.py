"""One joint's residual over time, and the instants at which a variable is within a range."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flexviz.charts import COLOURS, Chart, ChartAxis, ChartSeries, Ribbon, no_chart, thin
from flexviz.statistics import NORMAL_95
from flexviz.view.residual_maps import HEIGHT
from flexviz.wording import escape, number

if TYPE_CHECKING:
    from flexviz.identification import Identification

Array = NDArray[np.float64]

EMPTY = (
    "The residual against position, velocity, acceleration, load, time, group and frequency appears here, "
    "with the noise floor, after Run (step 3, Identify) or Find the missing effect (step 4, Diagnose)."
)
UNITS = {"position": "rad", "velocity": "rad/s", "acceleration": "rad/s²", "load": "Nm", "time": "s"}
VARIABLES = tuple(UNITS)
MAX_GROUPS = 12  # listed


@dataclass(frozen=True, eq=False)
class ResidualSamples:
    """The residual of one joint and the variables it may depend on, over all groups of a result.

    Attributes:
        names: group names.
        group: (N,) index into `names`.
        variables: name -> (N,), in the units of `UNITS`.
        residual: (N,) [Nm].
        floor: rms expected from measurement noise alone [Nm]; NaN if unknown.
    """

    names: tuple[str, ...]
    group: NDArray[np.int64]
    variables: dict[str, Array]
    residual: Array
    floor: float

    @classmethod
    def of(cls, result: Identification | None, joint: int) -> ResidualSamples | None:
        """The samples of one joint; None if the result has no residuals."""
        if result is None:
            return None
        names: list[str] = []
        rows: list[tuple[Array, ...]] = []
        group: list[Array] = []
        for name, series in result.residuals.items():
            if len(series.time) < 5:
                continue
            time, q = np.asarray(series.time), np.asarray(series.q[:, joint])
            velocity = np.gradient(q, time)
            steps = np.diff(time, prepend=2 * time[0] - time[1])
            near_gap = steps > 2.5 * np.median(steps)
            near_gap |= np.roll(near_gap, -1) | np.roll(near_gap, 1)
            acceleration, load = np.gradient(velocity, time), series.torque[:, joint]
            columns = (q, velocity, acceleration, load, time, series.residual[:, joint])
            rows.append(tuple(np.asarray(column)[~near_gap] for column in columns))
            group.append(np.full(np.count_nonzero(~near_gap), len(names)))
            names.append(name)
        if not rows:
            return None
        columns = [np.concatenate(pieces) for pieces in zip(*rows, strict=True)]
        floors = np.asarray(result.residual.noise_floor, dtype=float)
        floor = float(floors[joint]) if joint < len(floors) else float("nan")
        variables = dict(zip(VARIABLES, columns[:-1], strict=True))
        return cls(tuple(names), np.concatenate(group).astype(np.int64), variables, columns[-1], floor)

    def rows(self, group: str) -> NDArray[np.bool_]:
        """Mask (N,) of the samples of a group."""
        return self.group == (self.names.index(group) if group in self.names else -1)

    def limits(self, variable: str) -> tuple[float, float] | None:
        """Smallest and largest value of a variable, rounded outwards for the range slider."""
        if variable not in self.variables:
            return None
        values = self.variables[variable]
        low, high = float(values.min()), float(values.max())
        if not high > low:
            return None
        digit = 10.0 ** (np.floor(np.log10(high - low)) - 1)
        return float(np.floor(low / digit) * digit), float(np.ceil(high / digit) * digit)

    def instants(self, variable: str, low: float, high: float, group: str) -> tuple[Array, NDArray[np.bool_]]:
        """Times (M,) [s] in a group, and whether the variable is in the range there."""
        rows = self.rows(group)
        values = self.variables[variable][rows]
        return self.variables["time"][rows], (values >= low) & (values <= high)


def time_residual(found: ResidualSamples | None, name: str, shown: str) -> Chart:
    """One joint's residual over time in the shown group, with the noise ribbon."""
    if found is None:
        return no_chart("time", EMPTY)
    rows = found.rows(shown)
    time, residual = found.variables["time"][rows], found.residual[rows]
    if len(time) < 2:
        return no_chart("time", left_out(shown))
    x, (values,) = thin(time, [residual])
    half = np.full(len(x), NORMAL_95 * found.floor if np.isfinite(found.floor) else 0.0)
    return Chart(
        "time",
        f"Residual of {name} against time, {shown}",
        y=ChartAxis("residual", "Nm"),
        series=(ChartSeries("residual", COLOURS.residual, x, values, 1.3),),
        ribbons=(Ribbon("95 % of noise", COLOURS.reference, x, -half, half),),
        playhead=True,
        highlights=(),
        height=HEIGHT,
    ).spans(time[0], time[-1])


def left_out(group: str) -> str:
    """The reason for a group without residual."""
    return f"{group} has no residual: the last Run ignored it (Ignore in step Data)."


def stretches_of(time: Array, inside: NDArray[np.bool_]) -> tuple[tuple[float, float], ...]:
    """The intervals of time (M,) in which all instants are inside."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], inside, [False])).astype(int)))
    return tuple(
        (float(time[first]), float(time[last - 1]))
        for first, last in zip(edges[::2], edges[1::2], strict=True)
    )


def range_html(variable: str, low: float, high: float, inside: NDArray[np.bool_]) -> str:
    """A sentence on the highlighted range."""
    if not len(inside):
        return ""
    share = float(np.mean(inside))
    return (
        f'<div class="fv fv-dim">{escape(variable)} from {number(low, 3)} to {number(high, 3)} '
        f"{UNITS[variable]}: {100 * share:.0f} % of the time in this group, orange in the plot over time and "
        "on the robot's path.</div>"
    )


def groups_html(found: ResidualSamples | None, name: str) -> str:
    """The rms of the residual in every group."""
    if found is None:
        return ""
    cells = []
    for index, group in enumerate(found.names[:MAX_GROUPS]):
        part = found.residual[found.group == index]
        rms = number(float(np.sqrt(np.mean(part**2))), 3)
        cells.append(f'<span class="fv-joint">{escape(group)} <b>{rms}</b></span>')
    floor = f" Noise floor {number(found.floor, 2)}." if np.isfinite(found.floor) else ""
    return f'<div class="fv">Rms residual of {escape(name)} [Nm]: {"".join(cells)}{floor}</div>'
