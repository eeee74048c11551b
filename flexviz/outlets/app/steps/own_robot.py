"""One's own robot in step 1: what a URDF and logs hold is drafted, corrected, checked and opened."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from pathlib import Path

from flexviz.checks import Issue
from flexviz.content.view import (
    known_scales,
    own_columns_html,
    own_files_html,
    own_runs_html,
    own_state_html,
    remedy_text,
)
from flexviz.content.wording import escape, issue_message, issue_text
from flexviz.data.importing import Draft, carry, edited, gaps
from flexviz.outlets.app.access import is_loopback
from flexviz.outlets.app.explained import ExplainedHtml
from flexviz.outlets.app.own_robot import MAPPING_FILE, ImportOwn, LookAtFiles, OwnFiles, OwnSet, mapping_text
from flexviz.outlets.app.page import Page, dim, off, warning
from flexviz.outlets.app.page_script import ROW_LABEL
from flexviz.outlets.app.state import Changed, Turn
from flexviz.outlets.app.steps.own_entries import LABEL, ColumnEntry, Constants, Runs
from flexviz.outlets.app.store import Store
from flexviz.outlets.app.style import hidden, label_width
from flexviz.outlets.app.uploads import new_folder
from flexviz.outlets.app.workspace import output_dir
from flexviz.robot.mounting import DIRECTIONS

MOST_REMEDIES = 6  # buttons at once
STOPPED = "stopped; the form is as it was"


class OwnRobot:
    """The form. It is shown while there are files for it, and keeps its entries through every failure."""

    def __init__(self, store: Store, page: Page) -> None:
        self._store, self._page = store, page
        machine = "this machine" if is_loopback(page.server.get_host()) else "the machine that runs flexviz"
        self.where = f"Nothing leaves {machine}."
        self.on_close: Callable[[], None] = lambda: None
        self._urdf, self._logs = Path(), tuple[Path, ...]()
        self._due = False  # whether they are to be read
        self._own: OwnFiles | None = None
        self._not_used: dict[str, str] = {}  # name -> why, of files refused before
        self._issues: tuple[Issue, ...] = ()
        self._checked, self._edits = False, 0
        gui = page.gui
        self.folder = gui.add_folder("Your own robot", visible=False)
        with self.folder:
            self._files = ExplainedHtml(gui)
            hint = "drafts the mapping of these files again"
            self._again = page.button("Read the files", self._read_again, visible=False, hint=hint)
            self._body = gui.add_folder(None, visible=False)
        with self._body:
            hint = "axis of the URDF's base along which things fall: not −z for a robot on a wall; "
            hint += "others are stated in the mapping (gravity = …)"
            self._mounting = page.dropdown("Gravity along", tuple(DIRECTIONS), self._mount, hint=hint)
            self._constants = Constants(page, self._changed, self._problem)
            self._typed = ExplainedHtml(gui)
            self._state = ExplainedHtml(gui)
            self._remedies = [
                page.button(f"Remedy {i + 1}", lambda i=i: self._remedy(i), visible=False, color="orange")
                for i in range(MOST_REMEDIES)
            ]
            self._name = page.watch(gui.add_text("Set name", "", hint="of the new set in ./sessions"))
            self._open = page.button("Open", lambda: self._import(opens=True), color="orange")
            self._check = page.button("Check data", lambda: self._import(opens=False))
            self._anyway = page.button("Open anyway", lambda: self._import(opens=True, accept=True))
            self._download = page.client_button("Download mapping", self._send)
            self._table = ExplainedHtml(gui)
            row = page.watch(gui.add_text(ROW_LABEL, ""), self.choose_row)
            self._entry = ColumnEntry(page, self._changed)
            self._run_table = ExplainedHtml(gui)
            self._runs = Runs(page, lambda: self._changed((), ""), self._problem)
        with self.folder:
            self._discard = page.button(
                "Discard", self.close, hint="forgets these files; nothing was written"
            )
        for handle in (self._name, self._mounting):
            page.style(label_width, handle, LABEL)
        page.style(hidden, row)
        page.row((self._open, self._check, self._anyway))
        store.subscribe(Changed.ACTIVITY, self._activity, Turn.CONTROLS)

    # -- files ---------------------------------------------------------------------------------------

    def begin(self, urdf: Path, logs: Sequence[Path], not_used: Mapping[str, str]) -> None:
        """Look at these files, as soon as nothing else is running."""
        self._urdf, self._logs, self._not_used = urdf, tuple(logs), dict(not_used)
        self._due = self.folder.visible = True
        self._read()

    def hide(self) -> None:
        """Hide the form; what it waits for is stopped."""
        for kind in (LookAtFiles, ImportOwn):
            self._store.tasks.stop(kind)
        self._own, self._due = None, False
        self.folder.visible = self._body.visible = False

    def close(self) -> None:
        """Hide the form and forget its files."""
        self.hide()
        self.on_close()

    def _read(self) -> None:
        """Read the files if that is due and nothing is running; else say what happens."""
        store, names = self._store, ", ".join(path.name for path in (self._urdf, *self._logs))
        if self._due and store.runs(LookAtFiles):
            store.tasks.stop(LookAtFiles)  # and then begins again
        elif self._due and not store.running:
            self._due = False
            store.await_task(
                LookAtFiles(self._urdf, self._logs), self._seen, begin="reading the logs", stopped=STOPPED
            )
        if self._own is None:
            text = f"Reading {names} …" if store.runs(LookAtFiles) else f"{names}: not read"
            text = f"{names}: read when the running computation ends" if self._due else text
            failed = not self._due and not store.running and store.message.tone == "bad"
            self._files.content = dim(escape(text)) if not failed else warning(escape(store.message.text))
        self._again.visible = self._own is None and not self._due and not store.running

    def _read_again(self) -> None:
        self._due = True
        self._read()

    def _activity(self) -> None:
        if self.folder.visible:
            self._read()
            self._enable()

    def _seen(self, own: OwnFiles) -> None:
        """Show what the files hold; entries made for files of the same columns stay."""
        if self._due or not self.folder.visible:
            return  # newer files have come, or these were discarded
        if self._own is not None and carry(self._own.draft, own.draft, own.preview):
            self._checked = False
        else:
            self._name.value = Path(own.robot).stem
            self._issues, self._checked = own.issues, not gaps(own.draft)
            self._constants.show(own.draft)
            self._show_mounting(own.draft)
        self._own = own
        refused = self._not_used | dict(own.refused)
        self._files.content = own_files_html(
            own.robot, own.joints, own.logs, refused, self.where, own.draft.notes
        )
        self._problem("")
        self._constants.draft = own.draft
        self._entry.show(own)
        self._runs.show(own)
        self._body.visible = True
        self._draw()
        lacking = gaps(own.draft)
        said = f"still to be stated: {lacking[0]}" if lacking else "the logs are read: press Open"
        self._store.say(said, "warn" if lacking else "")

    # -- entries -------------------------------------------------------------------------------------

    def _changed(self, joints: Sequence[str], signal: str) -> None:
        """An entry was changed: what was said of it is out of date."""
        self._checked, self._edits = False, self._edits + 1
        self._issues = (
            tuple(
                issue
                for issue in self._issues
                if signal not in issue.signal or not set(joints) & set(issue.joints)
            )
            if signal
            else self._issues
        )
        self._draw()

    def _mount(self, direction: str) -> None:
        """Gravity points along this axis of the base; what was said of the torques is out of date."""
        if self._own is not None:
            self._own.draft.gravity = DIRECTIONS[direction]
            self._issues = ()
            self._changed((), "")

    def _show_mounting(self, draft: Draft) -> None:
        self._mounting.value = next(name for name, down in DIRECTIONS.items() if down == draft.gravity)

    def _problem(self, text: str) -> None:
        self._typed.content = f'<div class="fv fv-doubt">{escape(text)}</div>' if text else ""

    def choose_row(self, row: str) -> None:
        """Let the table's row with this label be corrected."""
        if self._own is not None:
            self._entry.choose(row)

    def _remedy(self, index: int) -> None:
        """Apply a remedy, and check again."""
        own, fixable = self._own, self._fixable()
        if own is None or index >= len(fixable):
            return
        issue = fixable[index]
        own.draft.accept(issue.remedies, issue_message(issue))
        self._show_mounting(own.draft)
        self._issues = tuple(other for other in self._issues if other is not issue)
        self._checked, self._edits = False, self._edits + 1
        self._entry.refresh()
        self._draw()
        self._import(opens=False)

    def _fixable(self) -> list[Issue]:
        return [issue for issue in self._issues if issue.remedies]

    def _draw(self) -> None:
        own = self._own
        if own is None:
            return
        self._constants.refresh()
        lacking = gaps(own.draft)
        self._state.content = own_state_html(lacking, self._issues, self._checked, own.draft.drive)
        scales = known_scales(edited(own.draft))
        self._table.content = own_columns_html(own.draft, own.preview, scales, self._issues, own.prismatic)
        self._run_table.content = own_runs_html(own.draft)
        fixable = self._fixable()
        for i, button in enumerate(self._remedies):
            button.visible = i < len(fixable)
            if i < len(fixable):
                button.label = remedy_text(fixable[i].remedies)
        self._enable()

    def _enable(self) -> None:
        lacking = gaps(self._own.draft) if self._own else ["files"]
        busy = "a computation is running (Stop ends it)" if self._store.running else ""
        why = busy or (f"still to be stated: {lacking[0]}" if lacking else "")
        wrong = any(issue.severity == "wrong" for issue in self._issues)
        off(self._open, why, "checks the data, writes the set into ./sessions and opens it")
        off(self._check, why, "compares the data with the robot; writes nothing")
        off(self._anyway, why or ("" if wrong else "nothing is wrong: press Open"), "although it looks wrong")
        off(self._download, "", "the mapping file, for flexviz import")
        for button, issue in zip(self._remedies, self._fixable(), strict=False):
            off(button, busy, issue_text(issue))

    # -- the set -------------------------------------------------------------------------------------

    def _import(self, opens: bool, accept: bool = False) -> None:
        """Check the data; write and open the set if `opens`."""
        own, edits = self._own, self._edits
        if own is None or self._store.running or gaps(own.draft):
            return
        out = new_folder(output_dir(), self._name.value) if opens else None

        def done(result: OwnSet) -> None:
            self._issues, self._checked = result.issues, edits == self._edits
            self._draw()
            if result.folder is not None:
                self._store.open_path(result.folder)
                self.close()
            elif any(issue.severity == "wrong" for issue in result.issues):
                self._store.say("the data contradict an entry: see the remedies", "bad")
            else:
                self._store.say("checked: nothing is wrong; press Open")

        if out is not None:
            out.parent.mkdir(parents=True, exist_ok=True)
        task = ImportOwn(deepcopy(own.draft), self._urdf, out, accept)
        self._store.await_task(task, done, begin="importing" if opens else "checking", stopped=STOPPED)

    def _send(self, client: int) -> None:
        """Send the mapping; the logs and the URDF belong into the same folder."""
        if self._own is not None:
            name = f"{Path(self._own.robot).stem}-{MAPPING_FILE}"
            text = mapping_text(self._own.draft, self._urdf.parent / name)
            self._page.send_file(client, name, text.encode())
            self._store.say(f"{name} sent: put it into the folder of the logs")
