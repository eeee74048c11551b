"""The ranked findings of a diagnosis, each with its evidence and its buttons."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

from flexviz.app.page import Page, off
from flexviz.app.uplot import ChartColumn
from flexviz.view import card_html, evidence_chart, finding_html

if TYPE_CHECKING:
    from flexviz.diagnosis import Finding

MAX_FINDINGS = 8
HEIGHT = 170  # [pixels] of the evidence


class FindingList:
    """A fixed number of entries for findings; the first one is open."""

    def __init__(self, page: Page, add: Callable[[int], None]) -> None:
        self._findings: tuple[Finding, ...] = ()
        self.entries = [FindingEntry(page, index, add) for index in range(MAX_FINDINGS)]

    def show(self, findings: Sequence[Finding], why: str, group: str) -> None:
        """Show the findings, the best one in full; `why`: the reason that none can be added now."""
        anew = tuple(findings) != self._findings
        self._findings = tuple(findings)
        for index, entry in enumerate(self.entries):
            if anew:
                entry.opened = index == 0
            entry.show(self._findings[index] if index < len(self._findings) else None, why, group)


class FindingEntry:
    """One finding's text, chart, explanation and buttons.

    Attributes:
        opened: whether its evidence is shown.
    """

    def __init__(self, page: Page, index: int, add: Callable[[int], None]) -> None:
        self._index = index
        self._finding: Finding | None = None
        self._group = ""
        self.opened = index == 0
        gui = page.gui
        self._text = gui.add_html("", visible=False)
        self._toggle = page.button("Show evidence", self._switch, visible=False)
        self.add = page.button(
            "Add and refit", partial(add, index), color="blue" if index == 0 else "gray", visible=False
        )
        self._folder = gui.add_folder(None, visible=False)
        self._chart = ChartColumn(page.server, self._folder)
        self._card = gui.add_html("", visible=False)
        page.row((self._toggle, self.add))

    def show(self, finding: Finding | None, why: str, group: str) -> None:
        """Show a finding with its evidence in a group; None hides the entry."""
        self._finding, self._group = finding, group
        for handle in (self._text, self._toggle, self.add, self._card):
            handle.visible = finding is not None
        if finding is None:
            self._folder.visible = False
            return
        self._text.content = finding_html(finding, self._index + 1, full=self._index == 0)
        self._card.content = card_html(finding.effect)
        off(self.add, why, "adds this effect, identifies and diagnoses again")
        self._show_evidence(finding)

    def _show_evidence(self, finding: Finding) -> None:
        there = finding.evidence is not None
        why = "" if there else "only screened briefly, so there is no evidence"
        off(self._toggle, why, "the residual with this effect's signature over it")
        shown = self.opened and there
        self._toggle.label = "Hide evidence" if shown else "Show evidence"
        self._folder.visible = shown
        if shown:
            self._chart.show((evidence_chart(finding, self._group, height=HEIGHT),))

    def _switch(self) -> None:
        self.opened = not self.opened
        if self._finding is not None:
            self._show_evidence(self._finding)
