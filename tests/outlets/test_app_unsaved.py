"""Work that was never saved is offered again, continued, and gone once it is saved. Without a browser."""

from __future__ import annotations

from pathlib import Path

import pytest

from flexviz.content.session import Autosave, Session, find_unsaved
from flexviz.outlets.app.application import Application
from flexviz.outlets.app.server import start_server
from flexviz.outlets.app.sets import open_set
from flexviz.outlets.app.steps.data import DataStep
from flexviz.outlets.app.workspace import output_dir, unsaved_dir
from tests.app_running import status, until, use
from tests.small_set import write_small_set


def test_unsaved_work_is_offered_continued_and_saved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    opened = open_set(write_small_set(tmp_path / "small"))
    session = Session.of(opened.measurements)
    session = session.then("offset", session.analysis.with_effects(["torque_offset:joint1"]))
    keeper = Autosave(unsaved_dir)
    keeper.keep(session, opened.measurements)
    keeper.close()  # as at the end of a process: what it kept stays
    server = start_server("127.0.0.1", 0)
    app = Application(server, opened)
    unsaved = next(step for step in app.dock.steps if isinstance(step, DataStep)).unsaved
    try:
        assert unsaved._button.visible and not app.store.session.past
        assert "never saved" in unsaved._text.content
        use(app, "Continue unsaved work")
        until(app, lambda: bool(app.store.session.past))
        assert app.store.analysis.effects == ("torque_offset:joint1",) and app.store.folder is None
        assert not unsaved._button.visible
        app.store.change("refine", app.store.analysis.with_fit(refine=True))
        assert unsaved.keeper.flush()
        assert find_unsaved(unsaved_dir(), opened.measurements.path) is None  # it is this process's own now
        use(app, "Save session")
        until(app, lambda: "session saved" in status(app))
        assert [folder.name[:6] for folder in output_dir().iterdir()] == ["small-"]
    finally:
        app.close()
        server.stop()
