"""The recording of the session into a file in ./sessions, while one works.

A recording started late begins with all results so far.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

from flexviz.analysis.diagnosis import Diagnosis
from flexviz.analysis.identification import Identification
from flexviz.base.errors import FlexvizError, one_line
from flexviz.content.wording import effect_text_name
from flexviz.outlets.app.state import Changed, FitProgress
from flexviz.outlets.app.store import Store
from flexviz.outlets.app.workspace import new_recording

if TYPE_CHECKING:
    from flexviz.outlets.recording import LiveRecording

CLOSING_TIME = 20.0  # [s] that the end of the application waits for a recording


class RecordedSession:
    """One recording, what it has been told of the session, and the rest as it comes."""

    def __init__(self, store: Store) -> None:
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
    """Feeds the open recording.

    `call(action, value)` calls in the loop's thread. `heard(state, value)` is told there when a recording is
    open (the recording), closed (its file), or has failed (the reason).
    """

    def __init__(
        self,
        store: Store,
        call: Callable[[Callable[[Any], None], Any], None],
        heard: Callable[[State, Any], None],
    ) -> None:
        self._store, self._call, self._heard = store, call, heard
        self._wanted: RecordedSession | None = None
        self._threads: list[threading.Thread] = []
        self._ended = False
        for changes, told in (
            (Changed.NEW_STATE | Changed.HISTORY, RecordedSession.note),
            (Changed.NEW_STATE, RecordedSession.results),
            (Changed.FIT, RecordedSession.iterations),
            (Changed.DERIVED, RecordedSession.derived),
        ):
            store.subscribe(changes, partial(self._told, told))
        store.subscribe(Changed.CLOSED, self._close)

    def _told(self, told: Callable[[RecordedSession, LiveRecording], None]) -> None:
        if (open_one := self._open) is not None:
            told(*open_one)

    @property
    def _open(self) -> tuple[RecordedSession, LiveRecording] | None:
        wanted = self._wanted
        return None if wanted is None or wanted.recording is None else (wanted, wanted.recording)

    def start(self) -> None:
        """Start a recording, if there is none; reported through `heard`."""
        if self._wanted is not None:
            return
        measurements, recorded = self._store.measurements, RecordedSession(self._store)
        file = new_recording(measurements.name)
        self._wanted = recorded
        failed = partial(self._tell, recorded, "failed")

        def begin() -> LiveRecording:
            from flexviz.outlets.recording import LiveRecording  # heavy

            recording = LiveRecording(measurements, file, on_failure=failed)
            if self._ended:
                recording.close()
            return recording

        self._in_thread(recorded, "open", begin)

    def stop(self) -> None:
        """Close the recording; reported through `heard`."""
        if (open_one := self._open) is not None:
            self._in_thread(open_one[0], "closed", open_one[1].close)
        self._wanted = None

    def _close(self) -> None:
        self._ended = True
        self.stop()
        for thread in self._threads:
            thread.join(timeout=CLOSING_TIME)

    def size(self) -> int:
        """Bytes written to the file so far."""
        file = None if (open_one := self._open) is None else open_one[1].file
        return file.stat().st_size if file is not None and file.is_file() else 0

    def _in_thread(self, recorded: RecordedSession, state: State, action: Callable[[], Any]) -> None:
        """Call `action` in another thread, and report the state that this leads to."""

        def run() -> None:
            try:
                self._tell(recorded, state, action())
            except FlexvizError as error:
                self._tell(recorded, "failed", str(error))
            except Exception as error:  # whatever a disk makes of it
                self._tell(recorded, "failed", one_line(f"{type(error).__name__}: {error}"))

        self._threads = [thread for thread in self._threads if thread.is_alive()]
        thread = threading.Thread(target=run, name="flexviz-record", daemon=True)
        self._threads.append(thread)
        thread.start()

    def _tell(self, recorded: RecordedSession, state: State, value: Any) -> None:
        self._call(partial(self._happened, recorded, state), value)

    def _happened(self, recorded: RecordedSession, state: State, value: Any) -> None:
        wanted = self._wanted is recorded
        if state == "open":
            if not wanted:  # switched off meanwhile
                self._in_thread(recorded, "closed", value.close)
                return
            recorded.begin(value)
        elif state == "failed":
            if not wanted:
                return
            self._wanted, lost = None, recorded.recording
            if lost is not None and not lost.failure:
                self._in_thread(recorded, "closed", lost.close)
        self._heard(state, value)


def model_label(effects: tuple[str, ...]) -> str:
    """Short description of a model."""
    return "with " + ", ".join(effect_text_name(name) for name in effects) if effects else "present model"
