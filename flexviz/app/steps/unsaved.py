"""Unsaved work: saved automatically, and offered again after a crash."""

from __future__ import annotations

from flexviz.app.change import Changed, Turn
from flexviz.app.page import Page, warning
from flexviz.app.store import Store
from flexviz.app.workspace import unsaved_dir
from flexviz.errors import InputError
from flexviz.session import Autosave, Unsaved, find_unsaved

AUTOSAVE_DELAY = 2.0  # [s] after a change without a result


class UnsavedWork:
    """Saves the session automatically, and offers unsaved work of an earlier run."""

    def __init__(self, store: Store, page: Page) -> None:
        self._store = store
        self._found: Unsaved | None = None
        self._due = AUTOSAVE_DELAY
        self.keeper = Autosave(unsaved_dir, lambda text: page.call(store.fail, text))
        self._text = page.gui.add_html("", visible=False)
        self._button = page.button(
            "Continue unsaved work", self._continue, color="orange", visible=False,
            hint="opens the automatically saved session; Undo goes through its history",
        )  # fmt: skip
        store.subscribe(Changed.OPENED, self._opened, Turn.CONTROLS)
        store.subscribe(Changed.RESULT | Changed.DIAGNOSIS, self._keep_at_once)
        store.subscribe(Changed.ANALYSIS, self._keep)
        store.subscribe(Changed.SAVED, self._saved)
        store.subscribe(Changed.CLOSED, self.keeper.close)

    def _opened(self) -> None:
        """Look for unsaved work on the open set."""
        store, before = self._store, self._found
        self.keeper.begin()
        if before is not None and store.folder == before.folder.resolve():
            self.keeper.inherit(before, store.session, store.measurements)
            store.set_folder(None)  # it is saved under a new name
        try:
            self._found = find_unsaved(unsaved_dir(), store.measurements.path, store.folder)
        except (InputError, OSError):
            self._found = None
        if store.folder is None and before is not None and self._found == before:
            self._found = None  # it is already open
        self._text.visible = self._button.visible = self._found is not None
        if self._found is not None:
            when = self._found.when.astimezone()
            self._text.content = warning(f"Work of {when:%Y-%m-%d %H:%M} on this set was never saved.")

    def _keep_at_once(self) -> None:
        self._due = 0.0

    def _keep(self) -> None:
        """Save the new state; results immediately."""
        self.keeper.keep(self._store.session, self._store.measurements, self._due)
        self._due = AUTOSAVE_DELAY

    def _saved(self) -> None:
        """Discard the automatic copy, unless the session has changed since it was saved."""
        store = self._store
        self.keeper.saved()
        if store.saved is not None and not store.analysis.same_as(store.saved.analysis):
            self.keeper.keep(store.session, store.measurements)

    def _continue(self) -> None:
        if self._found is not None:
            self._store.open_path(self._found.folder, "unsaved work")
