"""Start values of the set's own model."""

from __future__ import annotations

from collections.abc import Callable

from flexviz.identification import identify
from flexviz.measurements import MeasurementSet
from flexviz.model import FlexibleModel
from flexviz.parallel import Background
from flexviz.progress import StopCallback

GivenStart = FlexibleModel | Callable[[], FlexibleModel | None] | None


class OwnStart:
    """A given model, or else that of a plain identification, which begins at once beside the search.

    Args:
        measurements: the set.
        given: a model, or a function that finds one when needed; None: plain identification.
        should_stop: called between its fits.
    """

    def __init__(
        self, measurements: MeasurementSet, given: GivenStart, should_stop: StopCallback | None
    ) -> None:
        self._given = given
        self._plain = Background(
            lambda: identify(measurements, should_stop=should_stop).model, begin=given is None
        )

    def use(self, model: FlexibleModel) -> None:
        """Start from this model."""
        self.close()
        self._given = model

    def model(self) -> FlexibleModel:
        """The start values."""
        found = self._given() if callable(self._given) else self._given
        return found if found is not None else self._plain.result()

    def close(self) -> None:
        """End the plain identification."""
        self._plain.close()
