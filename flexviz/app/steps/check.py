"""Check: what the chosen groups and effects can identify, before a run; updated automatically."""

from __future__ import annotations

import time
from functools import partial
from typing import TYPE_CHECKING

from flexviz.app.change import Changed, Turn
from flexviz.app.page import Page, dim, off, warning
from flexviz.app.store import Store
from flexviz.app.tasks import CheckParameters
from flexviz.session import Settings
from flexviz.view import check_html

if TYPE_CHECKING:
    from flexviz.identification import Identification

SETTLE = 0.7  # [s] without another change before the next check


class ParameterCheck:
    """The button and its sentence in the store, from a trial fit whose values are discarded.

    After the first check, or change of a group's role or an effect, the sentence follows the settings.
    """

    def __init__(self, store: Store, page: Page) -> None:
        self._store = store
        self._follows = False
        self._seen: Settings | None = None  # the settings before the latest change
        self._of: Settings | None = None  # the settings of the sentence
        self._asked: Settings | None = None
        self._due: float | None = None
        self.button = page.button("Check", self._run)
        page.command("Check what can be identified", self._run)
        store.subscribe(Changed.OPENED, self._opened, Turn.CONTROLS)
        store.subscribe(Changed.NEW_STATE, self._new_state, Turn.CONTROLS)
        store.subscribe(Changed.OPENED | Changed.ANALYSIS | Changed.ACTIVITY, self._refresh, Turn.CONTROLS)
        store.subscribe(Changed.TICK, self._tick, Turn.CONTROLS)

    def _opened(self) -> None:
        self._follows = False
        self._seen = self._of = self._asked = self._due = None

    def _new_state(self) -> None:
        """Keep the sentence up to date after a change of roles or effects."""
        new, old = self._store.analysis.settings, self._seen
        if old is not None and (new.roles, new.effects) != (old.roles, old.effects):
            self._follows |= not self._store.analysis.up_to_date

    def _refresh(self) -> None:
        """Schedule another check if the settings have changed."""
        analysis = self._store.analysis
        settings = self._seen = analysis.settings
        hint = "which parameters these groups and effects can identify; changes nothing"
        off(self.button, self._store.why_not, hint)
        if not self._follows or settings in (self._of, self._asked):
            return
        if analysis.up_to_date:  # the result holds it
            self._show(settings, check_html(analysis.identification))
        else:
            self._due = time.monotonic() + SETTLE

    def _tick(self) -> None:
        """Check if due and idle."""
        if self._due is not None and time.monotonic() >= self._due and not self._store.running:
            self._run()

    def _run(self) -> None:
        """Check the current settings."""
        store, analysis = self._store, self._store.analysis
        self._due = None
        if store.why_not:
            return
        self._asked = analysis.settings
        store.set_check(dim("Checking what can be identified."))
        store.tasks.start(
            CheckParameters(analysis.without_result()),
            partial(self._done, analysis.settings),
            failed=partial(self._failed, analysis.settings),
            stopped=partial(self._stopped, analysis.settings),
        )

    def _done(self, settings: Settings, result: Identification) -> None:
        if settings == self._store.analysis.settings:
            self._show(settings, check_html(result))
        else:
            self._stopped(settings)

    def _failed(self, settings: Settings, reason: str) -> None:
        self._show(settings, warning(f"Check: {reason}"))

    def _stopped(self, settings: Settings) -> None:
        if self._asked == settings:
            self._asked = None
            self._store.set_check("")

    def _show(self, settings: Settings, sentence: str) -> None:
        """Show the sentence of these settings."""
        self._follows, self._of, self._asked = True, settings, None
        self._store.set_check(sentence)
