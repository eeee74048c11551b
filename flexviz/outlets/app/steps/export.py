"""Export in step 1: the present model as files for simulators and controllers."""

from __future__ import annotations

from functools import partial

from flexviz.base.errors import InputError
from flexviz.content.blocks import Details, Items
from flexviz.content.rendering import panel
from flexviz.outlets.app.explained import ExplainedHtml
from flexviz.outlets.app.page import Page, off
from flexviz.outlets.app.state import Changed, Turn
from flexviz.outlets.app.store import Store
from flexviz.outlets.app.style import label_width
from flexviz.outlets.app.workspace import ExportModel, ModelFiles
from flexviz.outlets.exporting import formats_for

EVERYTHING = "everything"
TITLES = {
    "urdf": "URDF",
    "mjcf": "MuJoCo (MJCF)",
    "isaac": "Isaac Lab",
    "bam": "BAM",
    "yaml": "parameters, YAML",
    "json": "parameters, JSON",
    "c": "C",
    "python": "Python",
    "table": "tables, CSV",
}


class Export:
    """A format to choose, and the button that sends it."""

    def __init__(self, store: Store, page: Page) -> None:
        self._store, self._page = store, page
        self._names: dict[str, str] = {}  # title -> format
        self._format = page.dropdown("Export as", (EVERYTHING,))
        self.button = page.client_button("Export model", self._send, color="blue")
        self._left = ExplainedHtml(page.gui)
        page.style(label_width, self._format, "7em")
        page.client_command("Send the model as files", self._send)
        store.subscribe(Changed.OPENED, self._opened, Turn.CONTROLS)
        store.subscribe(Changed.OPENED | Changed.ANALYSIS, self._refresh, Turn.CONTROLS)

    def _opened(self) -> None:
        formats = formats_for(self._store.measurements)
        self._names = {EVERYTHING: "", **{TITLES.get(name, name): name for name in formats}}
        self._format.options = tuple(self._names)
        self._format.value = EVERYTHING

    def _refresh(self) -> None:
        self._left.content = ""
        why = "no model yet; press Find the missing effect (step 4) or Run (step 3) first"
        why = "" if self._store.analysis.identification is not None else why
        off(self.button, why, "the present model for simulators and controllers, as a file or a zip")

    def _send(self, client: int) -> None:
        if self.button.disabled:
            raise InputError(str(self.button.hint))
        store = self._store
        task = ExportModel(store.analysis, store.measurements, self._names[self._format.value])
        done = partial(self._sent, client)
        if store.running:  # its progress and Stop stay
            store.tasks.start(task, done)
        else:
            store.await_task(task, done, begin="exporting", stopped="stopped exporting")

    def _sent(self, client: int, made: ModelFiles) -> None:
        self._page.send_file(client, made.name, made.content)
        left = [Details("What the files do not say", [Items(made.left_out)])] if made.left_out else []
        self._left.content = panel(left)
        self._store.say(f"{made.name} sent")
