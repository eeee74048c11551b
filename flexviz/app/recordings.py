"""Live recordings of the session: into a file in ./sessions, to a running Rerun viewer, or both.

Each has a stream of its own, so that a viewer that goes away takes nothing from the file. One that is opened
late begins with all that is known by then.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Literal
from urllib.parse import urlsplit

from flexviz.app.gate import is_loopback
from flexviz.app.workspace import new_recording
from flexviz.errors import FlexvizError, InputError, one_line
from flexviz.wording import effect_text_name

if TYPE_CHECKING:
    from flexviz.app.application import Application
    from flexviz.diagnosis import Diagnosis, ResidualMap
    from flexviz.identification import Identification
    from flexviz.progress import Iteration
    from flexviz.recording.live import LiveRecording
    from flexviz.simulation import Run

Kind = Literal["file", "viewer"]
KINDS: tuple[Kind, ...] = ("file", "viewer")


class Recordings:
    """Tells every open recording what happens; only the loop's thread calls it.

    `heard(kind, state, value)` is called in the loop's thread when a recording has begun ("open", its file or
    None), has ended ("closed", what was written or None), or cannot go on ("failed", the reason).
    """

    def __init__(self, app: Application, heard: Callable[[Kind, str, Any], None]) -> None:
        self._app, self._heard = app, heard
        self._open: dict[Kind, LiveRecording] = {}
        self._wanted: dict[Kind, object] = {}  # what each is wanted for: another set is another recording
        self._threads: list[threading.Thread] = []
        self._ended = False
        self._newest: Identification | None = None  # what they all know
        self._diagnosis: Diagnosis | None = None
        app.on("recording", self._happened)

    # -- on and off ----------------------------------------------------------------------------------

    def start(self, kind: Kind, address: str = "") -> None:
        """Open one; `address` is the viewer's. Whether that worked is told through `heard`."""
        if kind in self._wanted:
            return
        measurements, mark = self._app.measurements, object()
        viewer = None if kind == "file" else local_address(address)
        file = new_recording(measurements.name) if kind == "file" else None
        self._wanted[kind] = mark

        def begin() -> None:
            from flexviz.recording.live import LiveRecording  # heavy

            recording = LiveRecording(
                measurements,
                file,
                viewer=viewer,
                on_failure=lambda reason: self._tell(kind, mark, "failed", reason),
            )
            if self._ended:
                recording.close()
            self._tell(kind, mark, "open", recording)

        self._in_thread(begin, kind, mark)

    def stop(self, kind: Kind) -> None:
        """Close one; what was written is told through `heard`."""
        mark = self._wanted.pop(kind, None)
        recording = self._open.pop(kind, None)
        if recording is not None:
            self._close(kind, mark, recording)

    def _close(self, kind: Kind, mark: object, recording: LiveRecording) -> None:
        def end() -> None:
            self._tell(kind, mark, "closed", recording.close())

        self._in_thread(end, kind, mark)

    def close(self) -> None:
        """Close all and wait for them."""
        self._ended = True
        for kind in KINDS:
            self.stop(kind)
        for thread in self._threads:
            thread.join(timeout=20.0)

    def size(self, kind: Kind = "file") -> int:
        """Bytes written so far."""
        recording = self._open.get(kind)
        file = None if recording is None else recording.file
        return file.stat().st_size if file is not None and file.is_file() else 0

    def tick(self) -> None:
        """Let go of a viewer that has gone away."""
        viewer = self._open.get("viewer")
        if viewer is not None and viewer.lost_viewer:
            reason = f"the Rerun viewer has gone: {one_line(viewer.lost_viewer)}"
            self._happened(("viewer", self._wanted.get("viewer"), "failed", reason))

    # -- what is told --------------------------------------------------------------------------------

    def began(self) -> None:
        """A solve begins: the iterations that follow are its own."""
        label = model_label(self._app.identify.effects_fitted)
        for recording in self._open.values():
            recording.started(label)

    def iterated(self, iteration: Iteration) -> None:
        """One iteration of it."""
        for recording in self._open.values():
            recording.iteration(iteration)

    def changed(self, label: str) -> None:
        """The session has gone on: new results, and what was done."""
        for recording in self._open.values():
            recording.note(label)
            self._results(recording, self._newest, self._diagnosis)
        self._remember()

    def note(self, text: str) -> None:
        """Something else that was done."""
        for recording in self._open.values():
            recording.note(text)

    def replayed(self, result: Identification, group: str, run: Run) -> None:
        """A result's own motion; only the newest result's is recorded."""
        if result is self._newest:
            for recording in self._open.values():
                recording.replayed(group, run)

    def mapped(self, result: Identification, maps: tuple[ResidualMap, ...]) -> None:
        """Where a result's model fails."""
        if result is self._newest:
            for recording in self._open.values():
                recording.mapped(maps)

    def _remember(self) -> None:
        analysis = self._app.session.analysis
        self._newest, self._diagnosis = analysis.identification, analysis.diagnosis

    def _results(
        self, recording: LiveRecording, known: Identification | None, looked: Diagnosis | None
    ) -> None:
        """The present state's results, where they are other than those that the recording knows."""
        from flexviz.observers import make_observer

        analysis = self._app.session.analysis
        result, diagnosis = analysis.identification, analysis.diagnosis
        if result is not None and result is not known:
            recording.observer(make_observer(result.observer_name, result.bandwidth))  # type: ignore[arg-type]
            recording.identified(result, model_label(analysis.fitted[4] if analysis.fitted else ()))
        if diagnosis is not None and diagnosis is not looked and analysis.diagnosis_up_to_date:
            recording.diagnosed(diagnosis, tuple(stair.step for stair in analysis.model_steps))

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

    def _tell(self, kind: Kind, mark: object, state: str, value: Any) -> None:
        self._app.queue.put("recording", (kind, mark, state, value), each=True)

    def _happened(self, what: tuple[Kind, object, str, Any]) -> None:
        kind, mark, state, value = what
        wanted = self._wanted.get(kind) is mark
        if state == "open":
            if not wanted:  # switched off meanwhile
                self._close(kind, mark, value)
                return
            self._open[kind] = value
            self._heard(kind, state, value.file)
            self._catch_up(value)
        elif state == "closed":
            self._heard(kind, state, value)
        elif wanted:
            self._wanted.pop(kind)
            lost = self._open.pop(kind, None)
            if lost is not None and not lost.failure:
                self._close(kind, object(), lost)
            self._heard(kind, state, value)

    def _catch_up(self, recording: LiveRecording) -> None:
        """All that is known before it began: the present results, and what a running solve has done."""
        app = self._app
        for step in (*app.session.past, app.session.present):
            recording.note(step.label)
        self._results(recording, None, None)
        for group, run in app.show.known.replays.items():
            recording.replayed(group, run)
        if app.show.known.maps:
            recording.mapped(app.show.known.maps)
        self._remember()
        if app.identify.fitting and app.identify.iterations:
            recording.started(model_label(app.identify.effects_fitted))
            for iteration in app.identify.iterations:
                recording.iteration(iteration)


def model_label(effects: tuple[str, ...]) -> str:
    """A model in a few words."""
    return (
        "with " + ", ".join(effect_text_name(name) for name in effects) if effects else "the model as it is"
    )


def local_address(text: str) -> str:
    """A viewer's address on this machine: from "", a port, host:port, or a whole one.

    A browser must not make this machine talk to another one.
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
            f'"{text[:60]}" is not on this machine; 127.0.0.1:9876, or the port of a viewer, would be right'
        )
    return text
