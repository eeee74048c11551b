"""A new step of the app is one class in a file and its line in the list of steps."""

from __future__ import annotations

from pathlib import Path

import pytest

from flexviz.outlets.app import application
from flexviz.outlets.app.steps import STEPS
from flexviz.outlets.app.steps.step import WorkflowStep
from tests.app_running import command, running, settle, status, use
from tests.small_set import write_small_set


class NotesStep(WorkflowStep):
    """Counts the groups on demand."""

    title = "Notes"

    def build(self) -> None:
        """A button, a command, a text."""
        self.count = self.page.button("Count the groups", self._count)
        self.text = self.page.gui.add_html("")
        self.page.command("Count all groups", self._count)

    def refresh(self) -> None:
        """Show how many groups are fitted."""
        self.text.content = f"{len(self.store.analysis.groups_with('fit'))} fitted"

    def _count(self) -> None:
        self.store.say(f"{len(self.store.measurements.groups)} groups")


def test_a_new_step_has_its_place_its_controls_and_its_key(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(application, "STEPS", (*STEPS, NotesStep))
    with running(tmp_path, write_small_set(tmp_path / "small")) as app:
        (step,) = (step for step in app.dock.steps if isinstance(step, NotesStep))
        assert "5 Notes" in app.dock._line.content and not step.folder.visible
        app.page.commands.touched(0.0)
        command(app, "Go to step Notes")
        settle(app)
        assert step.folder.visible and "Step Notes" in status(app) and "5 Notes ●" in app.dock._line.content
        before = step.text.content
        use(app, "Count the groups")
        assert "3 groups" in status(app)
        app.store.change("g1: Ignore", app.store.analysis.with_role("g1", "ignore"))
        assert step.text.content != before
