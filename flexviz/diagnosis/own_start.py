"""Start values of the set's own model."""

from __future__ import annotations

from collections.abc import Callable

from flexviz.diagnosis.fit_context import FitContext
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.equation import layout_of
from flexviz.identification import identify
from flexviz.measurements import MeasurementSet
from flexviz.model import FlexibleModel
from flexviz.parallel import Background
from flexviz.progress import StopCallback

LIMITS = THRESHOLDS.search

GivenStart = FlexibleModel | Callable[[], FlexibleModel | None] | None


class OwnStart:
    """A given model, or else a fit of the set's own model, which begins at once beside the search.

    Args:
        measurements: the set.
        given: a model, or a function that finds one when needed; None: a plain identification, and a few
            steps in units of the noise from there.
        should_stop: called between its steps.
    """

    def __init__(
        self, measurements: MeasurementSet, given: GivenStart, should_stop: StopCallback | None
    ) -> None:
        self._given, self._steps = given, 0
        self._own = Background(lambda: _fitted(measurements, should_stop), begin=given is None)

    def use(self, model: FlexibleModel, steps: int = 0) -> None:
        """Start from this model, to which so many steps in units of the noise led."""
        self.close()
        self._given, self._steps = model, steps

    def model(self) -> tuple[FlexibleModel, int]:
        """The start values, and how many steps in units of the noise led there."""
        found = self._given() if callable(self._given) else self._given
        return (found, self._steps) if found is not None else self._own.result()

    def close(self) -> None:
        """End the fit."""
        self._own.close()


class _Stopped(Exception):
    """Raised between steps when the user stops the fit."""


def _fitted(measurements: MeasurementSet, should_stop: StopCallback | None) -> tuple[FlexibleModel, int]:
    """The set's own model, and how many steps in units of the noise led there."""

    def check() -> None:
        if should_stop is not None and should_stop():
            raise _Stopped

    plain = identify(measurements, should_stop=should_stop).model
    layout, steps = layout_of(measurements), LIMITS.short_refit
    try:
        check()
        context = FitContext(measurements, layout)
        x = context.fit(layout, layout.vector(plain), iterations=steps, check=check).x
    except _Stopped:
        return plain, 0
    return layout.model(x), steps
