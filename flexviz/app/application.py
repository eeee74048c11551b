"""The application: one loop that acts on events and keeps the screen true to the session."""

from __future__ import annotations

import sys
import threading
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

import viser

from flexviz.app.controls import choose, press, press_of, watch
from flexviz.app.dock import Dock
from flexviz.app.events import Dispatcher, Event, EventQueue
from flexviz.app.hints import Hints
from flexviz.app.keys import Keys
from flexviz.app.recordings import Recordings
from flexviz.app.show import IDLE_JOBS, Show
from flexviz.app.steps.another import KEYS as OTHER_JOBS
from flexviz.app.steps.data import DataStep
from flexviz.app.steps.diagnose import DiagnoseStep
from flexviz.app.steps.files import KEYS as FILE_JOBS
from flexviz.app.steps.identify import IdentifyStep
from flexviz.app.steps.observer import ObserverStep
from flexviz.app.steps.view import ViewPanel
from flexviz.app.work import WARM, Opened
from flexviz.errors import FlexvizError, one_line
from flexviz.jobs import Job, JobEvent, Worker, load_modules
from flexviz.session import Analysis, Session
from flexviz.view import error_text

TICK = 0.1  # [s] playheads, the time slider and live plots follow this often
NOT_CONTROLS = ("job", "command", "client", "resized", "gone", "upload", "recording")


class Application:
    """What is open, and what happens on an event. Only the loop's thread changes it."""

    def __init__(self, server: viser.ViserServer, opened: Opened) -> None:
        self.server = server
        self.queue = EventQueue()
        self.worker = Worker()
        self._dispatcher = Dispatcher(self._mistake)
        self._stopped = threading.Event()
        self._ticked = 0.0
        self._message = ("", "")

        self.hints = Hints()
        self.dock = Dock(self)
        self.show = Show(self)
        self.data = DataStep(self)
        self.observer = ObserverStep(self)
        self.identify = IdentifyStep(self)
        with self.data.checked:
            self.identify.check.add_text()
        self.diagnose = DiagnoseStep(self)
        self.steps = {
            "Data": self.data,
            "Observer": self.observer,
            "Identify": self.identify,
            "Diagnose": self.diagnose,
        }
        self.view = ViewPanel(self)
        self.keys = Keys(self)
        self.dock.finish()
        self.on("job", self._job)
        self.on("client", self.show.scene.aim)
        self.on("resized", self.show.scene.resized)
        self.on("gone", self.show.scene.gone)

        @server.on_client_connect
        async def _(client: viser.ClientHandle) -> None:
            self.queue.put("client", client, each=True)

            @client.camera.on_update
            async def _(camera: viser.CameraHandle) -> None:
                self.queue.put("resized", camera.client)

        @server.on_client_disconnect
        async def _(client: viser.ClientHandle) -> None:
            self.queue.put("gone", client, each=True)

        self.open(opened)
        self.show.clock.play()
        self.show.playback.start()
        self.worker.submit("warm", load_modules, WARM, listener=lambda event: None)

    # -- wiring --------------------------------------------------------------------------------------

    def on(self, key: str, handler: Callable[[Any], None]) -> None:
        """Act on events of this key."""
        self._dispatcher.on(key, handler)

    def press(self, handle: Any, key: str, handler: Callable[[], None]) -> None:
        """Act on a button."""
        press(handle, self.queue, key)
        self.hints.add(handle)
        self.on(key, lambda _: handler())

    def press_of(self, handle: Any, key: str, handler: Callable[[int], None]) -> None:
        """Act on a button for the browser that pressed it."""
        press_of(handle, self.queue, key)
        self.hints.add(handle)
        self.on(key, handler)

    def watch(self, handle: Any, key: str, handler: Callable[[Any], None]) -> None:
        """Act on a control's value."""
        watch(handle, self.queue, key)
        self.on(key, handler)

    def choose(self, handle: Any, key: str, handler: Callable[[str], None]) -> None:
        """Act on a row of buttons."""
        choose(handle, self.queue, key)
        self.on(key, handler)

    def row(self, *buttons: Any, share: float | None = None) -> None:
        """Set buttons beside each other; each takes `share` of the row (None: the same for all)."""
        self.add_style(self.hints.row(buttons, share))

    def add_style(self, rule: str) -> None:
        """Add a CSS rule to the page."""
        self.dock.rules.append(rule)

    def submit(self, key: str, function: Callable[..., Any], *args: Any, in_process: bool = True) -> Job:
        """Start a job; what it has to say comes through the queue."""

        def listener(event: JobEvent) -> None:
            self.queue.put("job", event, each=True)

        return self.worker.submit(key, function, *args, listener=listener, in_process=in_process)

    # -- the session ---------------------------------------------------------------------------------

    def open(self, opened: Opened) -> None:
        """Show a set from its beginning."""
        for key in ("identify", "sweep", "diagnose", "check", *IDLE_JOBS):
            self.worker.stop(key)
        self.measurements = opened.measurements
        self.truth, self.missing = opened.truth, opened.shape.missing
        self.folder = opened.folder
        self.session = opened.session or Session.of(self.measurements)
        self.show.opened(opened)
        self.dock.opened()
        for step in self.steps.values():
            step.opened()
        self.say("")
        self.show.show_group()

    def saved(self, session: Session, folder: Path) -> None:
        """This session has been saved there."""
        self.folder = folder
        self.data.unsaved.saved(session)
        self.data.list_sets()

    def change(self, label: str, analysis: Analysis) -> None:
        """A new state of the analysis; everything that depends on it is drawn anew."""
        before = self.session.analysis
        self.session = self.session.then(label, analysis)
        if not analysis.same_as(before):
            self.recordings.changed(label)
        self._changed(before)

    def undo(self) -> None:
        """One state back."""
        before, label, self.session = self.session.analysis, self.session.present.label, self.session.undo()
        self._changed(before)
        if not self.session.analysis.same_as(before):
            self.say(f"undone: {label}")
            self.recordings.note(f"undone: {label}")

    def redo(self) -> None:
        """One undone state forward."""
        before, self.session = self.session.analysis, self.session.redo()
        self._changed(before)
        if not self.session.analysis.same_as(before):
            self.say(f"redone: {self.session.present.label}")
            self.recordings.note(f"redone: {self.session.present.label}")

    def _changed(self, before: Analysis) -> None:
        after = self.session.analysis
        if after.same_as(before):
            return
        self.data.unsaved.changed(before)
        if (after.observer, after.bandwidth) != (before.observer, before.bandwidth):
            self.show.plots.show_states()
        for step in self.steps.values():
            step.refresh()
        if after.identification is not before.identification:
            self.show.show_model()
        if after.diagnosis is not before.diagnosis or after.model_steps != before.model_steps:
            self.show.show_diagnosis()
        # last: who reads the new error, or sees Stop go out, finds plots and tables that go with it
        self.dock.refresh()
        self.say(*self._message)

    @property
    def recordings(self) -> Recordings:
        """The recordings that are under way."""
        return self.data.files.recordings

    @property
    def running(self) -> bool:
        """True while an identification, a sweep or a search for missing effects runs or waits."""
        return self.identify.running or self.observer.sweep.running or self.diagnose.running

    def why_not(self) -> str:
        """Why no fit can be started now, or ""."""
        if self.running:
            return "something runs"
        if not self.session.analysis.groups_with("fit"):
            return "no group is set to Fit in step Data"
        return ""

    def may_start(self, what: str) -> bool:
        """Whether a fit can be started now; says why not (a key or a command may ask for it at any time)."""
        why = self.why_not()
        if why:
            self.say(f"{what} is off: {why}", "bad")
        return not why

    def refresh_running(self) -> None:
        """Something has begun or ended: what may be pressed has changed."""
        for step in self.steps.values():
            step.refresh()
        self.dock.refresh()
        self.show.fill()

    def stop(self) -> None:
        """Stop what runs; identification and sweep keep what they have."""
        self.identify.stop()
        self.observer.sweep.stop()
        self.diagnose.stop()

    # -- words ---------------------------------------------------------------------------------------

    def say(self, message: str, tone: str = "") -> None:
        """Write the status line."""
        self._message = (message, tone)
        self.dock.say(message, error_text(self.session.analysis.identification), tone)

    def fail(self, reason: str) -> None:
        """Say what went wrong, where nobody overlooks it; the app stays usable."""
        self.say(reason, "bad")
        for client in self.server.get_clients().values():
            client.add_notification("That did not work", reason, color="red", auto_close_seconds=12)

    def set_dark(self, dark: bool) -> None:
        """Light or dark theme."""
        self.server.gui.configure_theme(dark_mode=dark, show_share_button=False, show_logo=False)

    # -- the loop ------------------------------------------------------------------------------------

    def run(self) -> None:
        """Act on events until `close`."""
        while not self._stopped.is_set():
            self.once(TICK / 2)

    def once(self, wait: float) -> None:
        """Act on one event (waiting `wait` [s] for it), on due commands, and on the passing of time."""
        event = self.queue.take(wait)
        if event is not None:
            if event.key not in NOT_CONTROLS:
                self.keys.touched(event.born)
            self._dispatcher.act(event)
        for key, who in self.keys.due():
            self._dispatcher.guard(Event(key), lambda key=key, who=who: self.keys.act(key, who))
        if time.monotonic() - self._ticked >= TICK:
            self._ticked = time.monotonic()
            self._dispatcher.guard(Event("tick"), self._tick)

    def close(self) -> None:
        """End the loop, the playback and the worker; keep what is not saved."""
        self._stopped.set()
        self.data.unsaved.close()
        self.recordings.close()
        self.data.another.close()
        self.show.playback.close()
        self.worker.close()

    def _tick(self) -> None:
        self.show.tick()
        self.identify.tick()
        self.data.files.tick()
        self.dock.tick()

    def _job(self, event: JobEvent) -> None:
        if event.job.key == "identify":
            self.identify.heard(event)
        elif event.job.key == "sweep":
            self.observer.sweep.heard(event)
        elif event.job.key == "diagnose":
            self.diagnose.heard(event)
        elif event.job.key in IDLE_JOBS:
            self.show.heard(event)
        elif event.job.key == "check":
            self.identify.check.heard(event)
        elif event.job.key in FILE_JOBS:
            self.data.files.heard(event)
        elif event.job.key in OTHER_JOBS:
            self.data.another.heard(event)
        elif event.job.key == "open":
            if event.kind == "done":
                self.open(event.value)
            elif event.kind == "failed":
                self.fail(event.value)
                self.data.refresh()

    def _mistake(self, event: Event, error: Exception) -> None:
        if not isinstance(error, FlexvizError):
            print(f"flexviz: acting on {event.key} failed", file=sys.stderr)
            traceback.print_exception(error)
        self.fail(
            str(error) if isinstance(error, FlexvizError) else one_line(f"{type(error).__name__}: {error}")
        )
