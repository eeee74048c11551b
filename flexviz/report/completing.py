"""What a report needs and a session does not hold yet, computed for its present model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from flexviz.errors import Cancelled
from flexviz.measurements import MeasurementSet
from flexviz.model import FlexibleModel
from flexviz.session import Analysis, with_roles

if TYPE_CHECKING:
    from flexviz.diagnosis import BandwidthCheck


def chosen_set(measurements: MeasurementSet, analysis: Analysis) -> MeasurementSet:
    """The set as a diagnosis of this state wants it: its groups' use, and all of the model's effects."""
    chosen = with_roles(measurements, dict(analysis.roles))
    return replace(chosen, effects=(*chosen.effects, *analysis.effects))


def guarded(
    measurements: MeasurementSet, analysis: Analysis, model: FlexibleModel, should_stop: Callable[[], bool]
) -> BandwidthCheck:
    """What moves with the observer's bandwidth, for the model that the diagnosis ended with."""
    from flexviz.diagnosis import check_bandwidth
    from flexviz.equation import layout_of

    def check() -> None:
        if should_stop():
            raise Cancelled

    chosen = chosen_set(measurements, analysis)
    layout = layout_of(chosen)
    return check_bandwidth(chosen, layout, layout.vector(model), check=check)
