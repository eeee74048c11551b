"""Step 1, Data: which set, and what each of its groups is used for."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexviz.app.controls import watch
from flexviz.app.steps.another import AnotherSet
from flexviz.app.steps.files import Files
from flexviz.app.steps.unsaved import UnsavedWork
from flexviz.app.style import label_width
from flexviz.app.work import open_set, sets_beside
from flexviz.session import ROLES
from flexviz.view import set_html
from flexviz.wording import number

if TYPE_CHECKING:
    from flexviz.app.application import Application

ROLE_NAMES = tuple(role.capitalize() for role in ROLES)


class DataStep:
    """Measurement set and group roles."""

    def __init__(self, app: Application) -> None:
        self._app = app
        gui = app.server.gui
        self._sets: dict[str, Path] = {}
        self._rows: list[Any] = []
        self._roles: dict[str, Any] = {}
        self.folder = gui.add_folder(None)
        with self.folder:
            self.unsaved = UnsavedWork(app)
            self._choice: Any = gui.add_dropdown("Measurement set", ("–",), initial_value="–")
            self._about = gui.add_html("")
            self._heading = gui.add_html(
                '<div class="fv"><b>Groups</b>: trajectory and payload, and their use</div>'
            )
            self._rows_folder = gui.add_folder(None)
            self._hint = gui.add_html("")
            self.checked = gui.add_folder(None)
            self.files = Files(app)
            self.another = AnotherSet(app)
            self._dark = gui.add_checkbox("Dark theme", False)
        app.add_style(label_width(self._choice._impl.uuid, "7.6em"))
        watch(self._choice, app.queue, "set")
        watch(self._dark, app.queue, "dark")
        app.on("set", self._chosen)
        app.on("dark", app.set_dark)

    def opened(self) -> None:
        """A new set is shown: its name, its facts, a row for each group."""
        measurements = self._app.measurements
        self.unsaved.opened()
        self.list_sets()
        self.files.opened()
        self._about.content = set_html(measurements, self._app.missing)
        for row in self._rows:
            row.remove()
        self._rows, self._roles = [], {}
        gui = self._app.server.gui
        for index, group in enumerate(measurements.groups):
            key = f"role{index}"
            with self._rows_folder:
                row = gui.add_dropdown(
                    self._row_label(group), ROLE_NAMES, initial_value=ROLE_NAMES[0],
                    hint=f"trajectory {group.trajectory}, payload {group.payload}, "
                    f"{number(group.duration, 3)} s",
                )  # fmt: skip
            watch(row, self._app.queue, key)
            self._app.on(key, lambda value, name=group.name: self._role(name, value))
            self._rows.append(row)
            self._roles[group.name] = row
        self.refresh()

    def list_sets(self) -> None:
        """Offer the sets and sessions there are."""
        shown = self._shown()
        self._sets = sets_beside(shown, self._app.measurements.path)
        name = next((n for n, p in self._sets.items() if p == shown), shown.name)
        self._choice.options = tuple(self._sets)
        self._choice.value = name

    def refresh(self) -> None:
        """Show the session's roles."""
        self.files.refresh()
        analysis = self._app.session.analysis
        for name, role in analysis.roles:
            if name in self._roles:
                self._roles[name].value = role.capitalize()
        fit = analysis.groups_with("fit")
        self._hint.content = (
            "" if fit else '<div class="fv fv-warn">No group is fitted: choose Fit for at least one.</div>'
        )

    def _shown(self) -> Path:
        """The folder of what is open, a set or a session."""
        return (self._app.folder or self._app.measurements.path).resolve()

    def _row_label(self, group: Any) -> str:
        label = f"{group.name}: {group.trajectory}, {group.payload}"
        return label if len(label) <= 40 else label[:39] + "…"

    def _chosen(self, name: str) -> None:
        path = self._sets.get(name)
        if path is None or path == self._shown():
            return
        self._app.say(f"opening {name}", "busy")
        self._app.submit("open", open_set, path, in_process=False)

    def _role(self, group: str, role: str) -> None:
        analysis = self._app.session.analysis.with_role(group, role.lower())  # type: ignore[arg-type]
        self._app.change(f"{group}: {role}", analysis)
        self._app.identify.check.changed()
