"""Step 1, Data: the measurement set and the role of each group."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from flexviz.app.change import Changed, Turn
from flexviz.app.page import warning
from flexviz.app.steps.another_set import AnotherSet
from flexviz.app.steps.files import Files
from flexviz.app.steps.step import WorkflowStep
from flexviz.app.steps.unsaved import UnsavedWork
from flexviz.app.style import label_width
from flexviz.app.tasks import sets_beside
from flexviz.measurements import Group
from flexviz.session import ROLES
from flexviz.view import set_html
from flexviz.wording import number

ROLE_NAMES = tuple(role.capitalize() for role in ROLES)
MAX_LABEL_LENGTH = 40  # characters of a group's label


class DataStep(WorkflowStep):
    """Measurement set and group roles."""

    title = "Data"

    def build(self) -> None:
        """The set, a row per group, files."""
        store, page, gui = self.store, self.page, self.page.gui
        self._sets: dict[str, Path] = {}
        self._roles: dict[str, Any] = {}  # group -> its row
        self.unsaved = UnsavedWork(store, page)
        self._choice = page.watch(
            gui.add_dropdown("Measurement set", ("–",), initial_value="–"), self._choose
        )
        self._about = gui.add_html("")
        gui.add_html('<div class="fv"><b>Groups</b>: trajectory and payload, and their use</div>')
        self._rows = gui.add_folder(None)
        self._hint = gui.add_html("")
        self._check = gui.add_html("")
        self.files = Files(store, page)
        self.another = AnotherSet(store, page)
        page.watch(gui.add_checkbox("Dark theme", False), page.set_dark)
        page.style(label_width, self._choice, "7.6em")
        store.subscribe(Changed.OPENED, self._opened, Turn.CONTROLS)
        store.subscribe(Changed.OPENED | Changed.FOLDER, self._list_sets, Turn.CONTROLS)
        store.subscribe(Changed.OPENED | Changed.CHECK, self._show_check, Turn.CONTROLS)

    def _opened(self) -> None:
        """Show the new set and one row per group."""
        measurements, page = self.store.measurements, self.page
        self._about.content = set_html(measurements, self.store.opened.shape.missing)
        for row in self._roles.values():
            row.remove()
        self._roles = {}
        for group in measurements.groups:
            about = f"trajectory {group.trajectory}, payload {group.payload}, {number(group.duration, 3)} s"
            with self._rows:
                row = page.gui.add_dropdown(
                    _label(group), ROLE_NAMES, initial_value=ROLE_NAMES[0], hint=about
                )
            self._roles[group.name] = page.watch(row, partial(self._use, group.name))

    def _list_sets(self) -> None:
        """List the available sets and sessions."""
        shown = self._shown()
        self._sets = sets_beside(shown, self.store.measurements.path)
        self._choice.options = tuple(self._sets)
        self._choice.value = next((name for name, path in self._sets.items() if path == shown), shown.name)

    def _show_check(self) -> None:
        self._check.content = self.store.check

    def refresh(self) -> None:
        """Show the roles."""
        analysis = self.store.analysis
        for name, role in analysis.roles:
            if name in self._roles:
                self._roles[name].value = role.capitalize()
        fitted = analysis.groups_with("fit")
        self._hint.content = "" if fitted else warning("No group is fitted: choose Fit for at least one.")

    def _shown(self) -> Path:
        """The folder of the open set or session."""
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
