"""Live recordings of the session: into a file in ./sessions, to a running Rerun viewer, or both.

Each has its own stream, so that a lost viewer does not affect the file. A recording started late begins with
all results so far.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Literal
from urllib.parse import urlsplit

from flexviz.analysis.diagnosis import Diagnosis
from flexviz.analysis.identification import Identification
from flexviz.base.errors import FlexvizError, InputError, one_line
from flexviz.content.wording import effect_text_name
from flexviz.outlets.app.access import is_loopback
from flexviz.outlets.app.state import Changed, FitProgress
from flexviz.outlets.app.store import Store
from flexviz.outlets.app.workspace import new_recording

if TYPE_CHECKING:
    from flexviz.outlets.recording import LiveRecording

Kind = Literal["file", "viewer"]
KINDS: tuple[Kind, ...] = ("file", "viewer")
CLOSING_TIME = 20.0  # [s] that the end of the application waits for one recording


class RecordedSession:
    """One recording, what it has been told of the session, and the rest as it comes."""

    def __init__(self, kind: Kind, store: Store) -> None:
        self.kind: Kind = kind
        self.recording: LiveRecording | None = None  # until it is open
        self._store = store
        self._result: Identification | None = None
        self._diagnosis: Diagnosis | None = None
        self._replays: set[str] = set()  # of that result
        self._maps: object = ()
        self._fit: FitProgress | None = None
        self._iterations = 0  # of that fit

    def begin(self, recording: LiveRecording) -> None:
        """Tell everything so far, including the iterations of a running fit."""
        self.recording, store = recording, self._store
        for step in store.session.steps:
            recording.note(step.label)
        self.results(recording)
        self.derived(recording)
        if store.running:
            self.iterations(recording)
        else:
            self._fit, self._iterations = store.fit, len(store.fit.iterations)

    def note(self, recording: LiveRecording) -> None:
        recording.note(self._store.last_action)

    def results(self, recording: LiveRecording) -> None:
        """Tell new results."""
        analysis = self._store.analysis
        result, diagnosis, fitted = analysis.identification, analysis.diagnosis, analysis.fitted
        if result is not self._result:
            self._replays, self._maps = set(), ()
            if result is not None:
                recording.observer(result.observer)
                recording.identified(result, model_label(fitted.effects if fitted else ()))
        if diagnosis is not None and diagnosis is not self._diagnosis and analysis.diagnosis_up_to_date:
            models = tuple(model.step for model in analysis.model_steps)
            recording.diagnosed(diagnosis, models)
        self._result, self._diagnosis = result, diagnosis

    def derived(self, recording: LiveRecording) -> None:
        """Tell simulated motion and residual maps of the newest result."""
        derived = self._store.kept.of(self._result)
        if self._result is None or derived is None:
            return
        for group, run in derived.replays.items():
            if group not in self._replays:
                recording.replayed(group, run)
        if derived.maps and derived.maps is not self._maps:
            recording.mapped(derived.maps)
        self._replays, self._maps = set(derived.replays), derived.maps

    def iterations(self, recording: LiveRecording) -> None:
        """Tell iterations, unless the fit leads to several results."""
        fit = self._store.fit
        if fit is not self._fit:
            self._fit, self._iterations = fit, 0
        new = fit.iterations[self._iterations :] if fit.single else []
        if new and not self._iterations:
            recording.started(model_label(fit.effects))
        for iteration in new:
            recording.iteration(iteration)
        self._iterations = len(fit.iterations)


State = Literal["open", "closed", "failed"]


class Recordings:
    """Feeds all open recordings.

    `call(action, value)` calls in the loop's thread. `heard(kind, state, value)` is told there when a
    recording is open, closed (its file, or None), or has failed (the reason).
    """

    def __init__(
        self,
        store: Store,
        call: Callable[[Callable[[Any], None], Any], None],
        heard: Callable[[Kind, State, Any], None],
    ) -> None:
        self._store, self._call, self._heard = store, call, heard
        self._wanted: dict[Kind, RecordedSession] = {}
        self._threads: list[threading.Thread] = []
        self._ended = False
        for changes, told in (
            (Changed.NEW_STATE | Changed.HISTORY, RecordedSession.note),
            (Changed.NEW_STATE, RecordedSession.results),
            (Changed.FIT, RecordedSession.iterations),
            (Changed.DERIVED, RecordedSession.derived),
        ):
            store.subscribe(changes, partial(self._tell_all, told))
        store.subscribe(Changed.TICK, self._tick)
        store.subscribe(Changed.CLOSED, self._close_all)

    def _tell_all(self, told: Callable[[RecordedSession, LiveRecording], None]) -> None:
        for recorded in self._wanted.values():
            if recorded.recording is not None:
                told(recorded, recorded.recording)

    def _tick(self) -> None:
        """Drop a viewer that has disconnected."""
        viewer = self._wanted.get("viewer")
        lost = viewer.recording.lost_viewer if viewer and viewer.recording else ""
        if viewer and lost:
            self._happened(viewer, "failed", f"the Rerun viewer has disconnected: {one_line(lost)}")

    def start(self, kind: Kind, address: str = "") -> None:
        """Start a recording, to the viewer at `address` if any; reported through `heard`."""
        if kind in self._wanted:
            return
        measurements, recorded = self._store.measurements, RecordedSession(kind, self._store)
        viewer = None if kind == "file" else local_address(address)
        file = new_recording(measurements.name) if kind == "file" else None
        self._wanted[kind] = recorded
        failed = partial(self._tell, recorded, "failed")

        def begin() -> LiveRecording:
            from flexviz.outlets.recording import LiveRecording  # heavy

            recording = LiveRecording(measurements, file, viewer=viewer, on_failure=failed)
            if self._ended:
                recording.close()
            return recording

        self._in_thread(recorded, "open", begin)

    def stop(self, kind: Kind) -> None:
        """Close a recording; reported through `heard`."""
        recorded = self._wanted.pop(kind, None)
        if recorded is not None and recorded.recording is not None:
            self._in_thread(recorded, "closed", recorded.recording.close)

    def _close_all(self) -> None:
        self._ended = True
        for kind in KINDS:
            self.stop(kind)
        for thread in self._threads:
            thread.join(timeout=CLOSING_TIME)

    def size(self) -> int:
        """Bytes written to the file so far."""
        recorded = self._wanted.get("file")
        file = recorded.recording.file if recorded and recorded.recording else None
        return file.stat().st_size if file is not None and file.is_file() else 0

    def _in_thread(self, recorded: RecordedSession, state: State, action: Callable[[], Any]) -> None:
        """Call `action` in another thread, and report the state that this leads to."""

        def run() -> None:
            try:
                self._tell(recorded, state, action())
            except FlexvizError as error:
                self._tell(recorded, "failed", str(error))
            except Exception as error:  # whatever a disk or a viewer makes of it
                self._tell(recorded, "failed", one_line(f"{type(error).__name__}: {error}"))

        self._threads = [thread for thread in self._threads if thread.is_alive()]
        thread = threading.Thread(target=run, name=f"flexviz-{recorded.kind}", daemon=True)
        self._threads.append(thread)
        thread.start()

    def _tell(self, recorded: RecordedSession, state: State, value: Any) -> None:
        self._call(partial(self._happened, recorded, state), value)

    def _happened(self, recorded: RecordedSession, state: State, value: Any) -> None:
        wanted = self._wanted.get(recorded.kind) is recorded
        if state == "open":
            if not wanted:  # switched off meanwhile
                self._in_thread(recorded, "closed", value.close)
                return
            recorded.begin(value)
        elif state == "failed":
            if not wanted:
                return
            lost = self._wanted.pop(recorded.kind).recording
            if lost is not None and not lost.failure:
                self._in_thread(recorded, "closed", lost.close)
        self._heard(recorded.kind, state, value)


def model_label(effects: tuple[str, ...]) -> str:
    """Short description of a model."""
    return "with " + ", ".join(effect_text_name(name) for name in effects) if effects else "present model"


def local_address(text: str) -> str:
    """A viewer address on this machine: "", a port, host:port, or a complete address.

    Browsers must not make this machine connect to another one.
    """
    text = text.strip()
    host = None
    if text and not text.isdigit():
        try:
            host = urlsplit(text if "://" in text else f"//{text}").hostname
        except ValueError:
            host = ""
    if host is not None and not is_loopback(host):
        raise InputError(
            f'"{text[:60]}" is not on this machine; expected a viewer at 127.0.0.1:9876, or its port'
        )
    return text
