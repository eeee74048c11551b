"""An identification as figures: `result.plot.residual(joint="joint2")`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from flexviz.analysis.laws import LawThroughData, laws_of
from flexviz.base.errors import InputError, choose_from
from flexviz.base.statistics import NORMAL_95
from flexviz.content.charts import COLOURS, Chart, ChartAxis, Figure, Ribbon, time_chart
from flexviz.content.results import law_chart
from flexviz.data.measurements import MeasurementSet

HEIGHT = 200  # [px]
R = TypeVar("R")

_identified: WeakKeyDictionary[Any, MeasurementSet] = WeakKeyDictionary()


def remember(result: R, measurements: MeasurementSet) -> R:
    """The result; its plots find the set as long as it lives."""
    _identified[result] = measurements
    return result


@dataclass(frozen=True, eq=False)
class IdentificationPlots:
    """Figures of an identification; a notebook displays them, `save` writes them."""

    result: Any  # an Identification

    def residual(self, joint: str | None = None, group: str | None = None) -> Figure:
        """The residual over time with the range of the measurement noise, of one joint or of all.

        `group` is by default the longest held-out one, else the longest fitted one.
        """
        result = self.result
        held_out = [name for name in result.validation_groups if name in result.residuals]
        chosen_group = group or str(max(held_out or result.residuals, key=self._samples, default=""))
        if chosen_group not in result.residuals:
            valid = choose_from(chosen_group, result.residuals)
            raise InputError(f'group "{chosen_group}" has no residual; {valid}', file=result.set_name)
        joints = result.residual.joints
        if joint is not None and joint not in joints:
            valid = choose_from(joint, joints)
            raise InputError(f'joint "{joint}" is not in the set; {valid}', file=result.set_name)
        chosen = [k for k, name in enumerate(joints) if joint in (None, name)]
        return Figure(tuple(self._residual(k, chosen_group) for k in chosen))

    def _samples(self, group: str) -> int:
        return len(self.result.residuals[group].time)

    def _residual(self, joint: int, group: str) -> Chart:
        series, summary = self.result.residuals[group], self.result.residual
        title = f"Residual of {summary.joints[joint]}, {group}"
        lines = [("residual", COLOURS.residual, series.residual[:, joint])]
        chart = time_chart("residual", title, "Nm", series.time, lines, height=HEIGHT)
        factor = 1e3 if chart.y.unit == "mNm" else 1e6 if chart.y.unit == "µNm" else 1.0
        half = np.full(len(chart.series[0].x), factor * NORMAL_95 * self.result.noise_in(group)[joint])
        band = (Ribbon("95 % of noise", COLOURS.reference, chart.series[0].x, -half, half),)
        return replace(chart, y=ChartAxis("residual", chart.y.unit), ribbons=band if half.any() else ())

    def law(
        self, effect: str, joint: str | None = None, *, measurements: MeasurementSet | None = None
    ) -> Figure:
        """The law of an effect in the model through its data: what the model leaves, plus the effect itself.

        `measurements` is needed only for a result that this program did not identify itself.

        Raises:
            InputError: for an effect or joint that the model does not have, or records that are too short.
        """
        result = self.result
        known = measurements or _identified.get(result)
        if known is None:
            message = "the measurement set of this result is not known, expected measurements=…"
            raise InputError(message, file=result.set_name)
        chosen = [one.text for one in result.model.effects]
        only = f"{effect}:{joint}" if f"{effect}:{joint}" in chosen else None
        own = replace(known, effects=())  # they are among the chosen ones
        laws = laws_of(own, result.model, chosen, result.chance_covariance, only)
        return laws_figure(laws, effect, joint, result.set_name)


def laws_figure(laws: Iterable[LawThroughData], effect: str, joint: str | None, name: str) -> Figure:
    """The laws of one effect, on one joint or on all; InputError without any, naming those that there are."""
    known = {f"{one.effect}:{one.joint}": one for one in laws if len(one.at) > 1}
    charts = [
        law_chart(one) for one in known.values() if (one.effect, joint or one.joint) == (effect, one.joint)
    ]
    if not charts:
        asked = effect if joint is None else f"{effect}:{joint}"
        raise InputError(f'there is no law of "{asked}"; {choose_from(asked, known)}', file=name)
    return Figure(tuple(charts))
