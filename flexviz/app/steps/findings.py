"""The ranked findings of a diagnosis, each with its evidence and its buttons."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from flexviz.app.charts import ChartColumn
from flexviz.app.controls import off
from flexviz.view import card_html, evidence_plot, finding_html

if TYPE_CHECKING:
    from flexviz.app.application import Application
    from flexviz.diagnosis import Finding

MOST = 8  # findings shown


class FindingList:
    """A fixed number of places that findings appear in; made inside the step's folder."""

    def __init__(self, app: Application, add: Callable[[int], None]) -> None:
        self._app = app
        self._findings: tuple[Finding, ...] = ()
        self._open: set[int] = {0}  # findings whose evidence is shown
        self._places = [_Place(app, index, add, self._toggle) for index in range(MOST)]

    @property
    def first_button(self) -> Any:
        """ "Add and refit" of the best finding."""
        return self._places[0].add

    def opened(self) -> None:
        """A new set is shown."""
        self._open = {0}

    def show(self, findings: Sequence[Finding], why: str) -> None:
        """Show these findings, the best one in full; `why` says why none can be added now."""
        if tuple(findings) != self._findings:
            self._open = {0}
        self._findings = tuple(findings)
        group = self._app.show.group.name
        for index, place in enumerate(self._places):
            finding = self._findings[index] if index < len(self._findings) else None
            place.show(finding, why, index in self._open, group)

    def redraw(self) -> None:
        """Another group is shown: its stretch of the evidence."""
        for index, place in enumerate(self._places):
            if index in self._open and index < len(self._findings):
                place.draw(self._findings[index], self._app.show.group.name)

    def _toggle(self, index: int) -> None:
        self._open ^= {index}
        if index < len(self._findings):
            self._places[index].evidence(
                self._findings[index], index in self._open, self._app.show.group.name
            )


class _Place:
    """One finding's text, chart, explanation and buttons."""

    def __init__(
        self, app: Application, index: int, add: Callable[[int], None], toggle: Callable[[int], None]
    ) -> None:
        gui = app.server.gui
        self._index = index
        self._text = gui.add_html("", visible=False)
        self._toggle = gui.add_button("Show evidence", color="gray", visible=False)
        self.add = gui.add_button("Add and refit", color="blue" if index == 0 else "gray", visible=False)
        self._folder = gui.add_folder(None, visible=False)
        self._chart = ChartColumn(app.server, self._folder)
        self._card = gui.add_html("", visible=False)
        app.press(self.add, f"add{index}", lambda: add(index))
        app.press(self._toggle, f"evidence{index}", lambda: toggle(index))
        app.row(self._toggle, self.add)

    def show(self, finding: Finding | None, why: str, open_: bool, group: str) -> None:
        """This finding, or nothing."""
        there = finding is not None
        for handle in (self._text, self._toggle, self.add, self._card):
            handle.visible = there
        if finding is None:
            self._folder.visible = False
            return
        text = finding_html(finding, self._index + 1, full=self._index == 0)
        if text != self._text.content:
            self._text.content = text
        card = card_html(finding.effect)
        if card != self._card.content:
            self._card.content = card
        off(self.add, why, "adds this effect, identifies again, and looks again at what is missing")
        self.evidence(finding, open_, group)

    def evidence(self, finding: Finding, open_: bool, group: str) -> None:
        """Show or hide the evidence."""
        there = getattr(finding, "evidence", None) is not None
        why = "" if there else "it was only tried briefly, and nothing was kept"
        off(self._toggle, why, "the residual with this effect's signature over it")
        self._toggle.label = "Hide evidence" if open_ and there else "Show evidence"
        self._folder.visible = open_ and there
        if open_ and there:
            self.draw(finding, group)

    def draw(self, finding: Finding, group: str) -> None:
        """Draw the evidence of one group."""
        self._chart.show((evidence_plot(finding, group, height=170),))
