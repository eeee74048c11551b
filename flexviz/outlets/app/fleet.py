"""The tab "Fleet": the sets of a batch, what was found, drift over their dates; a click opens a set."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from flexviz.base.errors import InputError
from flexviz.content.rendering import panel
from flexviz.content.wording import escape
from flexviz.data.measurements import FILE_NAME
from flexviz.outlets.app.explained import ExplainedHtml
from flexviz.outlets.app.page import Page, dim
from flexviz.outlets.app.page_script import NUMBER_LABEL, OPEN_LABEL
from flexviz.outlets.app.state import Changed
from flexviz.outlets.app.store import Store
from flexviz.outlets.app.uplot import ChartColumn
from flexviz.outlets.app.viser_private import TAB
from flexviz.outlets.batch import (
    FleetRow,
    about_set,
    drift_text,
    fleet_html,
    histories,
    history_chart,
    outliers,
    parameter_words,
)

NARROW_TABS = f"{TAB} {{ padding-inline: 7px !important; }}"  # one more fits into the row


class FleetTab:
    """Table of the sets, and the chosen set's robot over its dates.

    A browser names a set by its number in the table that was read at the start, never by a path.
    """

    def __init__(self, store: Store, page: Page, tab: Any, rows: list[FleetRow]) -> None:
        self._store, self._rows = store, rows
        self._lines, self._apart = histories(rows), outliers(rows)
        drifting = next((one.rows[0] for one in self._lines if one.drifts), 0)
        page.rules.append(NARROW_TABS)
        gui = page.gui
        with tab:
            self._table = gui.add_html("")
            number = gui.add_number(NUMBER_LABEL, drifting + 1, min=1, max=len(rows), step=1)
            self._number = page.watch(number, lambda _: self._chosen())
            page.button(OPEN_LABEL, self._open, hint="opens the set with this number")
            self._about = ExplainedHtml(gui)
            self._parameter = page.dropdown("Parameter", ("–",), lambda _: self._draw())
            self._drift = gui.add_html("")
        self._charts = ChartColumn(page.server, tab)
        store.subscribe(Changed.OPENED, self._chosen)

    @property
    def _index(self) -> int:
        return min(max(int(self._number.value) - 1, 0), len(self._rows) - 1)

    def _open(self) -> None:
        row = self._rows[self._index]
        if not (Path(row.path) / FILE_NAME).is_file():
            raise InputError("this set is not there any more", file=row.set)
        self._store.open_path(Path(row.path), row.set)

    def _chosen(self) -> None:
        """Show the chosen set and the parameters of its robot, those that drift first."""
        index, row = self._index, self._rows[self._index]
        path = self._store.measurements.path
        same = [i for i, one in enumerate(self._rows) if Path(one.path) == path]
        self._table.content = fleet_html(self._rows, index, same[0] if same else None)
        self._about.content = panel(about_set(row, self._apart, index))
        self._known = {parameter_words(one.parameter): one for one in self._lines if one.robot == row.robot}
        before = self._parameter.value
        self._parameter.options = tuple(self._known) or ("–",)
        if before in self._known and not self._known[next(iter(self._known))].drifts:
            self._parameter.value = before
        self._draw()

    def _draw(self) -> None:
        one = self._known.get(self._parameter.value)
        self._charts.show(() if one is None else (history_chart(one, "drift", 200),))
        self._drift.content = dim(escape(drift_text(one))) if one is not None else ""
