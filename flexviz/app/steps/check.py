"""Check: what the chosen groups and effects can identify, before anything is run; it renews itself."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from flexviz.app.controls import off
from flexviz.app.work import identify_set
from flexviz.jobs import JobEvent
from flexviz.view import check_html

if TYPE_CHECKING:
    from flexviz.app.application import Application

SETTLE = 0.7  # [s] without a further change before it is checked again


class Check:
    """The button, and the sentence in steps Data and Identify. A trial fit whose values are not kept."""

    def __init__(self, app: Application) -> None:
        self._app = app
        gui = app.server.gui
        self._of: tuple[Any, ...] | None = None  # the settings that the sentence belongs to
        self._asked: tuple[Any, ...] | None = None
        self._due: float | None = None
        self._button = gui.add_button("Check", color="gray")
        self._texts: list[Any] = []
        app.press(self._button, "check", self.run)

    @property
    def button(self) -> Any:
        """For the style sheet."""
        return self._button

    def add_text(self) -> None:
        """Show the sentence in the present folder."""
        self._texts.append(self._app.server.gui.add_html(""))

    def opened(self) -> None:
        """A new set is shown: nothing is known about it."""
        self._app.worker.stop("check")
        self._of = self._asked = self._due = None
        self._write("")

    def refresh(self) -> None:
        """The settings may have changed: then it is checked again after a moment."""
        analysis = self._app.session.analysis
        hint = "which parameters these groups and effects can identify; changes nothing"
        off(self._button, self._app.why_not(), hint)
        if self._of is None or self._of == analysis.settings or self._asked == analysis.settings:
            return
        if analysis.up_to_date:  # the table says it
            self._of = analysis.settings
            self._write(check_html(analysis.identification))
            return
        self._due = time.monotonic() + SETTLE

    def changed(self) -> None:
        """A group's use or an effect was changed by hand: from now on it is kept up to date."""
        if self._of is None:
            self._of = ()
        self.refresh()

    def tick(self) -> None:
        """Check when that is due and nothing else runs."""
        if self._due is not None and time.monotonic() >= self._due and not self._app.running:
            self.run()

    def run(self) -> None:
        """Check the present settings."""
        analysis = self._app.session.analysis
        self._due = None
        if self._app.why_not():
            return
        self._asked = analysis.settings
        self._write('<div class="fv fv-dim">Checking what can be identified.</div>')
        self._app.submit("check", identify_set, replace(analysis.without_result(), refine=False))

    def heard(self, event: JobEvent) -> None:
        """What the check has to say."""
        if event.kind in ("started", "progress"):
            return
        asked, self._asked = self._asked, None
        if event.kind == "done" and asked == self._app.session.analysis.settings:
            self._of = asked
            self._write(check_html(event.value))
        elif event.kind == "failed":
            self._of = asked
            self._write(f'<div class="fv fv-warn">Check: {event.value}</div>')
        else:
            self._write("")

    def _write(self, text: str) -> None:
        for handle in self._texts:
            if handle.content != text:
                handle.content = text
