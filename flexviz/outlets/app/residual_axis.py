"""The axis that the residuals over time share, and the box that zooms to the present one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from flexviz.content.session import first_fit, fit_before
from flexviz.content.view import BEFORE, BeforeAfter
from flexviz.content.wording import DrivingSignal, driving_signal
from flexviz.outlets.app.legend_panel import model_names
from flexviz.outlets.app.page import Page, put
from flexviz.outlets.app.state import Changed
from flexviz.outlets.app.store import Store

ZOOM = "Zoom to present"
HINT = "off: on the axis of the session's first model, together with the residual before in grey"


def signal_of(store: Store) -> DrivingSignal:
    """What drives the joints of the open set."""
    return driving_signal(store.measurements.drive is not None)


def before_after(store: Store) -> BeforeAfter:
    """The fits whose residuals are drawn."""
    before, name = fit_before(store.session), BEFORE
    if store.beside is not None:
        before, name = store.beside[1].result, model_names(store)[1]
    present = store.analysis.identification
    live = None if store.live is None or store.live.group != store.group.name else store.live.found
    return BeforeAfter(
        present, before, name, first_fit(store.session), store.view.zoomed, live, signal_of(store)
    )


class ResidualAxis:
    """The box of one tab, which draws its residuals anew after a change; the boxes of all tabs agree."""

    def __init__(self, store: Store, page: Page, draw: Callable[[], None]) -> None:
        self._store, self._draw = store, draw
        self._box = page.checkbox(
            ZOOM, False, lambda on: store.set_view(replace(store.view, zoomed=on)), hint=HINT
        )
        self._shown = self._now()
        store.subscribe(Changed.VIEW, self._changed)

    def _now(self) -> tuple[bool, int | None]:
        return self._store.view.zoomed, self._store.view.beside

    def _changed(self) -> None:
        if self._now() != self._shown:  # else a slider of the scene is dragged
            self._shown = self._now()
            put(self._box, value=self._store.view.zoomed)
            self._draw()
