"""The residual of one joint over time, before and after on one axis."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flexviz.analysis.identification import Identification, ObservedResidual
from flexviz.base.arrays import Array
from flexviz.base.statistics import NORMAL_95
from flexviz.content.charts import COLOURS, Chart, ChartAxis, ChartSeries, Ribbon, finite, no_chart, thin
from flexviz.content.view.residuals import EMPTY, HEIGHT, left_out
from flexviz.content.wording import TORQUE_SIGNAL, DrivingSignal

MARGIN = 1.05  # times the largest residual: end of the axis
BEFORE, RESIDUAL, FITTED, TUNED = "before", "residual", "as identified", "with this observer"  # of the lines


@dataclass(frozen=True, eq=False)
class BeforeAfter:
    """Whose residuals are drawn on one axis.

    Attributes:
        present: the fit that is shown, in colour.
        before: an earlier fit, or that of *Compare with*, in grey.
        name: what `before` is called.
        first: the first fit of the session, whose residual sets the axis.
        zoomed: whether the present residual is drawn alone, on an axis that suits it.
        live: the present model's residual with the observer that is being tuned; the fit itself is then grey.
        signal: what drives the joints, of which it is left.
    """

    present: Identification | None
    before: Identification | None = None
    name: str = BEFORE
    first: Identification | None = None
    zoomed: bool = False
    live: ObservedResidual | None = None
    signal: DrivingSignal = TORQUE_SIGNAL

    def drawn(self, group: str, joint: int) -> tuple[Array, Array] | None:
        """Time (M,) [s] and residual (M,) [Nm] in colour; None without one."""
        if self.live is not None:
            return self.live.time, finite(self.live.residual[:, joint])
        return over_time(self.present, group, joint)

    def grey(self, group: str, joint: int) -> tuple[str, tuple[Array, Array] | None]:
        """Name of the residual behind it, time (M,) [s] and residual (M,) [Nm]; None without one."""
        if self.live is not None:
            return FITTED, over_time(self.present, group, joint)
        # zoomed, a larger residual would be vertical strokes
        alone = self.zoomed or self.before is self.present
        return self.name, None if alone else over_time(self.before, group, joint)

    def largest(self, group: str, joint: int) -> float:
        """What the axis of a group has to hold [Nm]: the first residual, and any that is larger.

        0 if zoomed: then it has to hold no more than what is drawn.
        """
        of = () if self.zoomed else (self.first, self.before, self.present)
        found = [series for result in of if (series := over_time(result, group, joint)) is not None]
        return max((float(np.abs(values).max(initial=0.0)) for _, values in found), default=0.0)


def over_time(result: Identification | None, group: str, joint: int) -> tuple[Array, Array] | None:
    """Time (M,) [s] and residual (M,) [Nm] of one joint; None without a residual of the group."""
    series = None if result is None else result.residuals.get(group)
    if series is None or len(series.time) < 2:
        return None
    return series.time, finite(series.residual[:, joint])


def residual_chart(
    fits: BeforeAfter,
    joint: int,
    group: str,
    title: str,
    span: tuple[float, float] | None = None,
    floor: float = float("nan"),
) -> Chart | None:
    """The present residual of a joint in a span of time [s] in front of the one before; None without one.

    `floor` is the rms [Nm] that measurement noise alone would leave, drawn as a band of 95 %. The residual
    before is interpolated to the instants of the present one and held where its observer had no result yet.
    """
    drawn = fits.drawn(group, joint)
    if drawn is None or len(drawn[0]) < 2:
        return None
    time, values = drawn
    whole = time[0], time[-1]
    if span is not None and np.count_nonzero(inside := (time >= span[0]) & (time <= span[1])) > 1:
        time, values = time[inside], values[inside]
    name, before = fits.grey(group, joint)
    x, (line, *grey) = thin(time, [values] if before is None else [values, np.interp(time, *before)])
    lines = [ChartSeries(name, COLOURS.reference, x, other, 1.0) for other in grey]
    lines.append(ChartSeries(RESIDUAL if fits.live is None else TUNED, COLOURS.residual, x, line, 1.4))
    half = np.full(len(x), NORMAL_95 * floor)
    band = (Ribbon("95 % of noise", COLOURS.reference, x, -half, half),) if np.isfinite(floor) else ()
    noise = float(half[0]) if band else 0.0
    end = MARGIN * max(fits.largest(group, joint), float(np.abs(line).max()), noise)
    axis = ChartAxis(unit=fits.signal.unit, limits=(-end, end) if end > 0 else None)
    chart = Chart("residual", title, y=axis, series=tuple(lines), ribbons=band, playhead=True)
    return chart.spans(*(span or whole))


def time_residual(
    fits: BeforeAfter, joint: int, name: str, group: str, span: tuple[float, float] | None = None
) -> Chart:
    """One joint's residual over time [s] in a group, with the noise ribbon."""
    if fits.present is None:
        return no_chart("time", EMPTY)
    floor = fits.present.noise_in(group)[joint]
    chart = residual_chart(fits, joint, group, f"Residual of {name} against time, {group}", span, floor)
    if chart is None:
        return no_chart("time", left_out(group))
    return replace(chart, key="time", y=replace(chart.y, label="residual"), highlights=(), height=HEIGHT)
