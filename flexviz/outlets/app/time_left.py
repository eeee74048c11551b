"""The time left of what is running, which falls while there is no news."""

from __future__ import annotations

import time

from flexviz.base.progress import Progress
from flexviz.outlets.app.state import Changed
from flexviz.outlets.app.store import Store


class TimeLeft:
    """Says it in the status line, as long as nothing else is said there."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._news, self._told, self._said = Progress(), 0.0, ""  # the latest, when [s, monotonic], and how
        store.subscribe(Changed.PROGRESS, self._hear)
        store.subscribe(Changed.TICK, self._count_down)

    def _hear(self) -> None:
        self._news, self._told = self._store.news, time.monotonic()
        self._said = self._news.line

    def _count_down(self) -> None:
        text = self._news.later(time.monotonic() - self._told).line
        if self._store.running and self._store.message.text == self._said != text:
            self._said = text
            self._store.say(text, "busy")
