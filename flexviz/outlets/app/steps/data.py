"""Step 1, Data: the measurement set, the role of each group, and unsaved work on the set."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from flexviz.base.errors import InputError
from flexviz.content.rendering import panel
from flexviz.content.session import ROLES, Autosave, Unsaved, find_unsaved
from flexviz.content.topics import set_blocks
from flexviz.content.wording import number, temperature_text
from flexviz.data.measurements import Group
from flexviz.outlets.app.explained import ExplainedHtml
from flexviz.outlets.app.page import Page, warning
from flexviz.outlets.app.sets import sets_beside
from flexviz.outlets.app.state import Changed, Turn
from flexviz.outlets.app.steps.another_set import AnotherSet
from flexviz.outlets.app.steps.export import Export
from flexviz.outlets.app.steps.files import Files
from flexviz.outlets.app.steps.own_robot import OwnRobot
from flexviz.outlets.app.steps.step import WorkflowStep
from flexviz.outlets.app.store import Store
from flexviz.outlets.app.style import hidden_in_the_dark, label_width
from flexviz.outlets.app.workspace import unsaved_dir

ROLE_NAMES = tuple(role.capitalize() for role in ROLES)
MAX_LABEL_LENGTH = 40  # characters of a group's label
AUTOSAVE_DELAY = 2.0  # [s] after a change without a result


class DataStep(WorkflowStep):
    """Measurement set and group roles."""

    title = "Data"

    def build(self) -> None:
        store, page, gui = self.store, self.page, self.page.gui
        self._sets: dict[str, Path] = {}
        self._roles: dict[str, Any] = {}  # group -> its row
        self.own = OwnRobot(store, page)
        self.unsaved = UnsavedWork(store, page)
        self._choice = page.dropdown("Measurement set", ("–",), self._choose)
        self._about = ExplainedHtml(gui)
        ExplainedHtml(gui, '<div class="fv"><b>Groups</b>: trajectory and payload, and their use</div>')
        self._rows = gui.add_folder(None)
        self._hint = ExplainedHtml(gui)
        self._check = ExplainedHtml(gui)
        export = Export(store, page)
        self.next_buttons = {"export": export.button}
        self.files = Files(store, page)
        self.another = AnotherSet(store, page, self.own)
        page.command("Read the data again", lambda: store.open_path(self._shown()))
        page.style(hidden_in_the_dark, page.checkbox("Dark theme", False, page.set_dark))
        page.style(label_width, self._choice, "7.6em")
        store.subscribe(Changed.OPENED, self._opened, Turn.CONTROLS)
        store.subscribe(Changed.OPENED | Changed.FOLDER, self._list_sets, Turn.CONTROLS)
        store.subscribe(Changed.OPENED | Changed.CHECK, self._show_check, Turn.CONTROLS)

    def _opened(self) -> None:
        """Show the new set and one row per group."""
        measurements, page = self.store.measurements, self.page
        self._about.content = panel(set_blocks(measurements, self.store.opened.shape.missing))
        for row in self._roles.values():
            row.remove()
        self._roles = {}
        for group in measurements.groups:
            about = f"trajectory {group.trajectory}, payload {group.payload}, {number(group.duration, 3)} s"
            if group.temperature is not None:
                about += f", {temperature_text(group.temperature)}"
            with self._rows:
                use = partial(self._use, group.name)
                self._roles[group.name] = page.dropdown(_label(group), ROLE_NAMES, use, hint=about)

    def _list_sets(self) -> None:
        shown = self._shown()
        self._sets = sets_beside(shown, self.store.measurements.path)
        self._choice.options = tuple(self._sets)
        self._choice.value = next((name for name, path in self._sets.items() if path == shown), shown.name)

    def _show_check(self) -> None:
        self._check.content = self.store.check

    def refresh(self) -> None:
        analysis = self.store.analysis
        for name, role in analysis.roles:
            if name in self._roles:
                self._roles[name].value = role.capitalize()
        fitted = analysis.groups_with("fit")
        self._hint.content = "" if fitted else warning("No group is fitted: choose Fit for at least one.")

    def _shown(self) -> Path:
        return (self.store.folder or self.store.measurements.path).resolve()

    def _choose(self, name: str) -> None:
        path = self._sets.get(name)
        if path is not None and path != self._shown():
            self.store.open_path(path, name)

    def _use(self, group: str, role: str) -> None:
        analysis = self.store.analysis.with_role(group, role.lower())  # type: ignore[arg-type]
        self.store.change(f"{group}: {role}", analysis)


def _label(group: Group) -> str:
    label = f"{group.name}: {group.trajectory}, {group.payload}"
    return label if len(label) <= MAX_LABEL_LENGTH else label[: MAX_LABEL_LENGTH - 1] + "…"


class UnsavedWork:
    """Saves the session automatically, and offers unsaved work of an earlier run."""

    def __init__(self, store: Store, page: Page) -> None:
        self._store = store
        self._found: Unsaved | None = None
        self._due = AUTOSAVE_DELAY
        self.keeper = Autosave(unsaved_dir, lambda text: page.call(store.fail, text))
        self._text = ExplainedHtml(page.gui, visible=False)
        hint = "opens the automatically saved session; Undo goes through its history"
        self._button = page.button(
            "Continue unsaved work", self._continue, color="orange", visible=False, hint=hint
        )
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
            store.go(DataStep.title)  # where it is offered
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
