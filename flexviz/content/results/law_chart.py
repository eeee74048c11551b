"""The law of an effect through its data, as a chart: the proof of a finding."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from flexviz.base.arrays import Array
from flexviz.base.statistics import NORMAL_95
from flexviz.content.charts import COLOURS, PREFIXES, Chart, ChartAxis, ChartSeries, Ribbon, limits
from flexviz.content.wording import capitalised, effect_title, law_axes, lower, percent

HEIGHT = 320  # [px]
EDGE = 0.15  # of the height: free above and below data and law, where wide intervals are cut off


class LawLike(Protocol):
    """See `flexviz.analysis.laws.LawThroughData`."""

    @property
    def effect(self) -> str: ...
    @property
    def joint(self) -> str: ...
    @property
    def group(self) -> str | None: ...
    @property
    def payload(self) -> str | None: ...
    @property
    def variable(self) -> str: ...
    @property
    def unit(self) -> str: ...
    @property
    def quantity(self) -> str: ...
    @property
    def quantity_unit(self) -> str: ...
    @property
    def at(self) -> Array: ...
    @property
    def law(self) -> Array: ...
    @property
    def data(self) -> Array: ...
    @property
    def data_std(self) -> Array: ...
    @property
    def line(self) -> tuple[Array, Array, Array]: ...


def law_chart(law: LawLike, height: int = HEIGHT) -> Chart:
    """Binned partial residuals as points and the law as a line, both with their 95 % intervals."""
    largest = float(np.abs(law.law).max(initial=0.0))
    factor, prefix = next(((f, p) for f, p in PREFIXES if largest * f >= 0.1), PREFIXES[-1])
    factor, prefix = (factor, prefix) if law.quantity_unit in ("rad", "m") else PREFIXES[0]
    at, drawn, std = law.line
    data, line = factor * law.data, factor * drawn
    data_half, law_half = NORMAL_95 * factor * law.data_std, NORMAL_95 * factor * std
    title, (across, up) = effect_title(law.effect), law_axes(law.variable, law.quantity, law.joint)
    place = law.joint + (f", {law.group}" if law.group else "") + (f", {law.payload}" if law.payload else "")
    ribbons = (
        Ribbon("± 95 %", COLOURS.measured, law.at, data - data_half, data + data_half),
        Ribbon("", COLOURS.model, at, line - law_half, line + law_half),
    )
    return Chart(
        f"law:{law.effect}:{place}",
        f"{title} of {place}: its law through the data",
        ChartAxis(across, law.unit),
        ChartAxis(up, f"{prefix}{law.quantity_unit}", limits=limits([data, line], EDGE)),
        (
            ChartSeries("law", COLOURS.model, at, line, 2.6),
            ChartSeries("data", COLOURS.measured, law.at, data, 0.0, points=True),
        ),
        tuple(ribbon for ribbon in ribbons if (ribbon.high > ribbon.low).any()),
        description=f"{capitalised(up)} against the {across}, in {len(law.at)} bins: what "
        f"the model leaves and the law of {lower(title)} together. Data and law differ by "
        f"{law_difference(law)} of the law.",
        height=height,
    )  # fmt: skip


def law_difference(law: LawLike) -> str:
    """Rms of data − law in per cent of the law's rms."""
    off = np.sqrt(np.mean((law.data - law.law) ** 2)) / max(np.sqrt(np.mean(law.law**2)), 1e-300)
    return percent(float(off))
