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
    """A given model, or else that of a plain identification, which may work beside the search.

    Args:
        measurements: the set.
        given: a model, or a function that finds one when needed; None: plain identification.
        should_stop: called between its fits.
    """

    def __init__(
        self, measurements: MeasurementSet, given: GivenStart, should_stop: StopCallback | None
    ) -> None:
        self.measurements, self.given, self.should_stop = measurements, given, should_stop
        self._begun: Background[FlexibleModel] | None = None

    def begin(self) -> None:
        """Begin the plain identification in a copy of the process, unless a model is given."""
        if self.given is None and self._begun is None:
            self._begun = Background(self._plain)

    def use(self, model: FlexibleModel) -> None:
        """Start from this model."""
        self.close()
        self.given = model

    def model(self) -> FlexibleModel:
        """The start values."""
        found = self.given() if callable(self.given) else self.given
        if found is not None:
            return found
        begun, self._begun = self._begun, None
        return self._plain() if begun is None else begun.result()

    def close(self) -> None:
        """End the plain identification."""
        if self._begun is not None:
            self._begun.close()
            self._begun = None

    def _plain(self) -> FlexibleModel:
        return identify(self.measurements, should_stop=self.should_stop).model
