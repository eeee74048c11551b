"""Work that was never saved is offered again, continued, and gone once it is saved. Without a browser."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from flexviz.app.application import Application
from flexviz.app.server import start_server
from flexviz.app.work import open_set
from flexviz.app.workspace import output_dir, unsaved_dir
from flexviz.session import Autosave, Session, find_unsaved
from tests.small_set import write_small_set
from tests.test_app import act, status, until


def test_unsaved_work_is_offered_continued_and_saved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    opened = open_set(write_small_set(tmp_path / "small"))
    session = Session.of(opened.measurements)
    session = session.then("offset", session.analysis.with_effect("torque_offset:joint1", True))
    keeper = Autosave(unsaved_dir)
    keeper.keep(session, opened.measurements)
    keeper.close()  # as at the end of a process: what it kept stays
    server = start_server("127.0.0.1", 0)
    app = Application(server, opened)
    try:
        assert app.data.unsaved._button.visible and not app.session.past
        assert "never saved" in app.data.unsaved._text.content
        act(app, "continue")
        until(app, lambda: bool(app.session.past))
        assert app.session.analysis.effects == ("torque_offset:joint1",) and app.folder is None
        assert not app.data.unsaved._button.visible
        app.change("refine", replace(app.session.analysis, refine=True))
        assert app.data.unsaved.keeper.flush()
        assert find_unsaved(unsaved_dir(), opened.measurements.path) is None  # it is this process's own now
        act(app, "save")
        until(app, lambda: "session saved" in status(app))
        assert [folder.name[:6] for folder in output_dir().iterdir()] == ["small-"]
    finally:
        app.close()
        server.stop()
