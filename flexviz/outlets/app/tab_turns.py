"""The tab of the plots follows the task: what `layout.js` reads, which also has the pin."""

from __future__ import annotations

from typing import Any

from flexviz.base.jobs import Task
from flexviz.content.wording import escape
from flexviz.outlets.app.page import Page
from flexviz.outlets.app.state import Changed
from flexviz.outlets.app.store import Store
from flexviz.outlets.app.tasks import AddFreeCurve, Diagnose, Identify

STATES, CONVERGENCE, PROOF, COMPARE = (
    "States",
    "Convergence",
    "Where it fails",
    "Compare",
)  # labels of the tabs
OBSERVER = "Observer"  # title of the step


def turn_html(tab: str, count: int) -> str:
    """The tab to show, and a number that grows each time."""
    return f'<i data-fv-tab="{escape(tab)}" data-fv-turn="{count}" style="display: none"></i>'


class TabTurns:
    """Step Observer turns to the states, Run to convergence, a search to the proof, adding to the staircase.

    Undo, redo and looking at an earlier model turn nothing.
    """

    def __init__(self, store: Store, page: Page) -> None:
        self._store, self._count = store, 0
        self._shown: Any = page.gui.add_html(turn_html("", 0))
        self._task: Task[Any] | None = None  # the one that runs, and the analysis at its start
        self._before = store.analysis
        store.subscribe(Changed.STEP, self._step)
        store.subscribe(Changed.ACTIVITY, self._activity)
        self._first = store.search.first
        store.subscribe(Changed.SEARCH, self._search)

    def _turn(self, tab: str) -> None:
        self._count += 1
        self._shown.content = turn_html(tab, self._count)

    def _step(self) -> None:
        if self._store.step == OBSERVER:
            self._turn(STATES)

    def _search(self) -> None:
        """The first residual of a search has come."""
        before, self._first = self._first, self._store.search.first
        if self._first is not None and self._first is not before:
            self._turn(PROOF)

    def _activity(self) -> None:
        store = self._store
        if store.activity is not None:
            self._task, self._before = store.activity.task, store.analysis
            if isinstance(self._task, Identify):
                self._turn(CONVERGENCE)
            return
        task, self._task = self._task, None
        diagnosis = store.analysis.current_diagnosis
        if not isinstance(task, Diagnose | AddFreeCurve) or diagnosis is self._before.current_diagnosis:
            return
        if store.analysis.effects != self._before.effects:
            self._turn(COMPARE)
        elif diagnosis is not None and any(finding.law for finding in diagnosis.findings):
            self._turn(PROOF)
