"""Work that nobody saved: kept while one works, offered again after a crash."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flexviz.app.work import open_set
from flexviz.app.workspace import unsaved_dir
from flexviz.errors import InputError
from flexviz.session import Analysis, Autosave, Session, Unsaved, find_unsaved

if TYPE_CHECKING:
    from flexviz.app.application import Application

QUIET = 2.0  # [s] after which a change without a result is kept


class UnsavedWork:
    """Keeps the session, and offers what an earlier run left behind. Made inside the step's folder."""

    def __init__(self, app: Application) -> None:
        self._app = app
        self._found: Unsaved | None = None
        self.keeper = Autosave(unsaved_dir, lambda text: app.queue.put("not-kept", text))
        gui = app.server.gui
        self._text = gui.add_html("", visible=False)
        self._button = gui.add_button(
            "Continue unsaved work", color="orange", visible=False,
            hint="opens what was kept when flexviz ended without saving; Undo goes through its history",
        )  # fmt: skip
        app.press(self._button, "continue", self._continue)
        app.on("not-kept", app.fail)

    def opened(self) -> None:
        """Something is shown: is there unsaved work on it?"""
        app, before = self._app, self._found
        self.keeper.begin()
        if before is not None and app.folder == before.folder.resolve():
            self.keeper.inherit(before, app.session, app.measurements)
            app.folder = None  # it is saved under a name of its own
        try:
            self._found = find_unsaved(unsaved_dir(), app.measurements.path, app.folder)
        except (InputError, OSError):
            self._found = None
        if app.folder is None and before is not None and self._found == before:
            self._found = None  # it is what is open
        self._show()

    def changed(self, before: Analysis) -> None:
        """The session has changed: results are kept at once."""
        after = self._app.session.analysis
        results = after.identification is not before.identification or after.diagnosis is not before.diagnosis
        self.keeper.keep(self._app.session, self._app.measurements, 0.0 if results else QUIET)

    def saved(self, session: Session) -> None:
        """This session was saved: nothing else is unsaved, unless more was done meanwhile."""
        self.keeper.saved()
        if not self._app.session.analysis.same_as(session.analysis):
            self.keeper.keep(self._app.session, self._app.measurements)

    def close(self) -> None:
        """Keep what waits."""
        self.keeper.close()

    def _continue(self) -> None:
        if self._found is not None:
            self._app.say("opening unsaved work", "busy")
            self._app.submit("open", open_set, self._found.folder, in_process=False)

    def _show(self) -> None:
        found = self._found
        self._text.visible = self._button.visible = found is not None
        if found is not None:
            when = found.when.astimezone()
            self._text.content = (
                f'<div class="fv fv-warn">Work of {when:%Y-%m-%d %H:%M} on this set was never saved.</div>'
            )
