"""Live recordings of the session: into a file in ./sessions, to a running Rerun viewer, or both.

Each has its own stream, so that a lost viewer does not affect the file. A recording started late begins with
all results so far.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal
from urllib.parse import urlsplit

from flexviz.app.server import is_loopback
from flexviz.app.state import Changed, FitProgress
from flexviz.app.store import Store
from flexviz.app.workspace import new_recording
from flexviz.errors import FlexvizError, InputError, one_line
from flexviz.wording import effect_text_name

if TYPE_CHECKING:
    from flexviz.diagnosis import Diagnosis
    from flexviz.identification import Identification
    from flexviz.recording import LiveRecording

Kind = Literal["file", "viewer"]
KINDS: tuple[Kind, ...] = ("file", "viewer")
CLOSING_TIME = 20.0  # [s] that the end of the application waits for one recording


class RecordedSession:
    """What one recording has been told of the session, and the rest as it comes."""

    def __init__(self, recording: LiveRecording, store: Store) -> None:
        """Tell everything so far, including the iterations of a running fit."""
        self.recording, self._store = recording, store
        self._result: Identification | None = None
        self._diagnosis: Diagnosis | None = None
        self._replays: set[str] = set()  # of that result
        self._maps: object = ()
        self._fit: FitProgress | None = None if store.running else store.fit
        self._iterations = len(store.fit.iterations)  # of that fit
        for step in store.session.steps:
            recording.note(step.label)
        self.results()
        self.derived()
        if store.running:
            self.iterations()

    def results(self) -> None:
        """Tell new results."""
        from flexviz.observers import make_observer

        analysis = self._store.analysis
        result, diagnosis, fitted = analysis.identification, analysis.diagnosis, analysis.fitted_settings
        if result is not self._result:
            self._replays, self._maps = set(), ()
            if result is not None:
                observer = make_observer(result.observer_name, result.bandwidth)  # type: ignore[arg-type]
                self.recording.observer(observer)
                self.recording.identified(result, model_label(fitted.effects if fitted else ()))
        if diagnosis is not None and diagnosis is not self._diagnosis and analysis.diagnosis_up_to_date:
            models = tuple(model.step for model in analysis.model_steps)
            self.recording.diagnosed(diagnosis, models)
        self._result, self._diagnosis = result, diagnosis

    def derived(self) -> None:
        """Tell simulated motion and residual maps of the newest result."""
        derived = self._store.derived_of(self._result)
        if self._result is None or derived is None:
            return
        for group, run in derived.replays.items():
            if group not in self._replays:
                self.recording.replayed(group, run)
        if derived.maps and derived.maps is not self._maps:
            self.recording.mapped(derived.maps)
        self._replays, self._maps = set(derived.replays), derived.maps

    def iterations(self) -> None:
        """Tell iterations, unless the fit leads to several results."""
        fit = self._store.fit
        if fit is not self._fit:
            self._fit, self._iterations = fit, 0
        new = fit.iterations[self._iterations :] if fit.single else []
        if new and not self._iterations:
            self.recording.started(model_label(fit.effects))
        for iteration in new:
            self.recording.iteration(iteration)
        self._iterations = len(fit.iterations)


@dataclass(frozen=True)
class RecordingEvent:
    """A change of a recording's state.

    Attributes:
        mark: identifies the request that started it.
        value: the open recording, the written file (or None), or the reason of the failure.
    """

    kind: Kind
    mark: object
    state: Literal["open", "closed", "failed"]
    value: Any


class Recordings:
    """Feeds all open recordings.

    `call(action, value)` calls in the loop's thread, where `heard` gets every `RecordingEvent`.
    """

    def __init__(
        self,
        store: Store,
        call: Callable[[Callable[[Any], None], Any], None],
        heard: Callable[[RecordingEvent], None],
    ) -> None:
        self._store, self._call, self._heard = store, call, heard
        self._open: dict[Kind, RecordedSession] = {}
        self._wanted: dict[Kind, object] = {}  # mark of the current request
        self._threads: list[threading.Thread] = []
        self._ended = False
        store.subscribe(Changed.NEW_STATE | Changed.HISTORY, self._each(self._note))
        store.subscribe(Changed.NEW_STATE, self._each(RecordedSession.results))
        store.subscribe(Changed.FIT, self._each(RecordedSession.iterations))
        store.subscribe(Changed.DERIVED, self._each(RecordedSession.derived))
        store.subscribe(Changed.TICK, self._tick)
        store.subscribe(Changed.CLOSED, self._close_all)

    def _each(self, act: Callable[[RecordedSession], None]) -> Callable[[], None]:
        """An action that calls `act` with every open recording."""

        def call() -> None:
            for recorded in self._open.values():
                act(recorded)

        return call

    def _note(self, recorded: RecordedSession) -> None:
        recorded.recording.note(self._store.last_action)

    def _tick(self) -> None:
        """Drop a viewer that has disconnected."""
        viewer = self._open.get("viewer")
        if viewer is not None and viewer.recording.lost_viewer:
            reason = f"the Rerun viewer has disconnected: {one_line(viewer.recording.lost_viewer)}"
            self._happened(RecordingEvent("viewer", self._wanted.get("viewer"), "failed", reason))

    def start(self, kind: Kind, address: str = "") -> None:
        """Start a recording, to the viewer at `address` if any; reported through `heard`."""
        if kind in self._wanted:
            return
        measurements, mark = self._store.measurements, object()
        viewer = None if kind == "file" else local_address(address)
        file = new_recording(measurements.name) if kind == "file" else None
        self._wanted[kind] = mark

        def failed(reason: str) -> None:
            self._tell(kind, mark, "failed", reason)

        def begin() -> None:
            from flexviz.recording import LiveRecording  # heavy

            recording = LiveRecording(measurements, file, viewer=viewer, on_failure=failed)
            if self._ended:
                recording.close()
            self._tell(kind, mark, "open", recording)

        self._in_thread(begin, kind, mark)

    def stop(self, kind: Kind) -> None:
        """Close a recording; reported through `heard`."""
        mark, recorded = self._wanted.pop(kind, None), self._open.pop(kind, None)
        if recorded is not None:
            self._close(kind, mark, recorded.recording)

    def _close(self, kind: Kind, mark: object, recording: LiveRecording) -> None:
        self._in_thread(lambda: self._tell(kind, mark, "closed", recording.close()), kind, mark)

    def _close_all(self) -> None:
        """Close all recordings and wait."""
        self._ended = True
        for kind in KINDS:
            self.stop(kind)
        for thread in self._threads:
            thread.join(timeout=CLOSING_TIME)

    def size(self) -> int:
        """Bytes written to the file so far."""
        recorded = self._open.get("file")
        file = None if recorded is None else recorded.recording.file
        return file.stat().st_size if file is not None and file.is_file() else 0

    # -- other threads -------------------------------------------------------------------------------

    def _in_thread(self, action: Callable[[], None], kind: Kind, mark: object) -> None:
        def run() -> None:
            try:
                action()
            except FlexvizError as error:
                self._tell(kind, mark, "failed", str(error))
            except Exception as error:  # whatever a disk or a viewer makes of it
                self._tell(kind, mark, "failed", one_line(f"{type(error).__name__}: {error}"))

        self._threads = [thread for thread in self._threads if thread.is_alive()]
        thread = threading.Thread(target=run, name=f"flexviz-{kind}", daemon=True)
        self._threads.append(thread)
        thread.start()

    def _tell(self, kind: Kind, mark: object, state: Literal["open", "closed", "failed"], value: Any) -> None:
        self._call(self._happened, RecordingEvent(kind, mark, state, value))

    def _happened(self, event: RecordingEvent) -> None:
        kind, wanted = event.kind, self._wanted.get(event.kind) is event.mark
        if event.state == "open" and not wanted:  # switched off meanwhile
            self._close(kind, event.mark, event.value)
            return
        if event.state == "open":
            self._open[kind] = RecordedSession(event.value, self._store)
        elif event.state == "failed":
            if not wanted:
                return
            self._wanted.pop(kind)
            lost = self._open.pop(kind, None)
            if lost is not None and not lost.recording.failure:
                self._close(kind, object(), lost.recording)
        self._heard(event)


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
