"""A recording that grows with an analysis.

    recording = LiveRecording(measurements, "demo.rrd")            # a file; and, or, viewer="9876"
    recording.observer(make_observer("butterworth-zero-phase"))
    recording.started("with Coulomb friction")                     # a solve begins
    result = identify(measurements, progress=recording.progress)  # every iteration as it comes
    recording.identified(result)
    recording.replayed("g1", run)                                  # the identified model's simulated motion
    recording.diagnosed(diagnosis)
    recording.close()

Every call but `flush` and `close` puts its content into a queue and returns at once; one thread writes the
queue in order and flushes within a second. Flushed content survives the end of the program, however it ends.
"""

from __future__ import annotations

import queue
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from flexviz.errors import FlexvizError, InputError, one_line
from flexviz.measurements import MeasurementSet
from flexviz.observers import Observer
from flexviz.progress import Progress
from flexviz.recording.files import Recorded, Target
from flexviz.recording.recorder import FLUSH_INTERVAL, MAX_SAMPLES, Recorder
from flexviz.recording.stream import Stream, viewer_address

if TYPE_CHECKING:
    from flexviz.diagnosis import Diagnosis, ResidualMap, Step
    from flexviz.identification import Identification
    from flexviz.progress import Iteration
    from flexviz.simulation import Run

WRITE_TIMEOUT = 120.0  # [s] that `flush` and `close` wait for the queue


class LiveRecording:
    """A growing recording of one measurement set; all methods may be called from any thread.

    A failure (a full disk, a result that does not fit the set) is raised by `flush` and `close` only: it ends
    the recording, is kept in `failure` and passed to `on_failure`.

    Attributes:
        file: where it is written, or None.
        failure: why the recording has ended; empty while it goes on.
        lost_viewer: why the viewer receives nothing; empty while it does.
    """

    def __init__(
        self,
        measurements: MeasurementSet,
        file: str | Path | None = None,
        *,
        viewer: str | None = None,
        samples: int = MAX_SAMPLES,
        on_failure: Callable[[str], None] | None = None,
    ) -> None:
        """Open it and record the set's own signals and the measured robot.

        Args:
            measurements: the set.
            file: written from the start. An older file stays until this one is done: until then it is
                written beside it (see `file`), `close` moves it.
            viewer: a running viewer: "" for the default, a port, host:port, or an address.
            samples: recorded at most, per signal and group.
            on_failure: called once, from the recording's thread, with the reason in one line.

        Raises:
            InputError: neither file nor viewer, the file's folder does not exist, no viewer answers.
        """
        if file is None and viewer is None:
            raise InputError("a recording needs a file or a viewer")
        address = None if viewer is None else viewer_address(viewer)
        self._target = None if file is None else Target(Path(file))
        self.failure = ""
        self._on_failure = on_failure
        self._stream = Stream(measurements.name, self._target, address)
        self._recorder = Recorder(measurements, self._stream, samples)
        self._queue: queue.Queue[Callable[[], object] | None] = queue.Queue()
        self._begun = time.monotonic()
        self._lock = threading.Lock()
        self._closed = False
        self._written: Recorded | None = None
        self._put(partial(self._recorder.begin, self._flush))
        self._thread = threading.Thread(target=self._work, name="flexviz-recording", daemon=True)
        self._thread.start()

    @property
    def file(self) -> Path | None:
        return None if self._target is None else self._target.part

    @property
    def lost_viewer(self) -> str:
        return self._stream.lost

    # -- what is recorded ----------------------------------------------------------------------------

    def observer(self, observer: Observer) -> None:
        """All states of an observer, unless they are recorded already."""
        self._put(partial(self._recorder.observe, observer, self._flush))

    def started(self, label: str = "") -> None:
        """Begin a solve: the iterations and the result that follow belong to it."""
        self._begun = time.monotonic()
        self._put(partial(self._recorder.start, label))

    def progress(self, news: Progress) -> None:
        """News of the running solve, as `identify` tells it."""
        if news.iteration is not None:
            self.iteration(news.iteration)

    def iteration(self, iteration: Iteration) -> None:
        """One iteration of the running solve."""
        seconds = time.monotonic() - self._begun
        self._put(partial(self._recorder.iteration, iteration, seconds))

    def identified(self, result: Identification, label: str = "") -> None:
        """A result: residuals, parameters, iterations not sent yet; `label`: its model in a few words."""
        self._put(partial(self._recorder.result, result, label))

    def replayed(self, group: str, run: Run) -> None:
        """The newest result's model simulated in a group: its signals, and the second robot."""
        self._put(partial(self._recorder.run, group, run))

    def mapped(self, maps: Sequence[ResidualMap]) -> None:
        """Where the newest result's model fails."""
        self._put(partial(self._recorder.maps, tuple(maps)))

    def diagnosed(self, diagnosis: Diagnosis, steps: Sequence[Step] = ()) -> None:
        """A diagnosis; `steps`: the models before it, if it has only one itself."""
        self._put(partial(self._recorder.diagnosis, diagnosis, tuple(steps)))

    def note(self, text: str) -> None:
        """A line in the recording's log."""
        self._put(partial(self._recorder.note, text))

    # -- its end -------------------------------------------------------------------------------------

    def flush(self, timeout: float = WRITE_TIMEOUT) -> None:
        """Wait until everything so far is in the file.

        Raises:
            FlexvizError: the recording has failed, or takes longer than `timeout` [s].
        """
        done = threading.Event()
        self._put(lambda: (self._recorder.flush(), done.set()))
        end = time.monotonic() + timeout
        while not done.wait(0.05) and not self.failure:
            if time.monotonic() > end:
                raise FlexvizError(f"the recording is not written after {timeout:g} s")
        if self.failure:
            raise FlexvizError(self.failure)

    def close(self, timeout: float = WRITE_TIMEOUT) -> Recorded | None:
        """Write the rest, check the file and move it to its place; None without a file.

        Raises:
            FlexvizError: the recording has failed, or takes longer than `timeout` [s].
        """
        with self._lock:
            closed, self._closed = self._closed, True
        if not closed:
            self._queue.put(None)
        self._thread.join(timeout)
        if self._thread.is_alive():
            raise FlexvizError(f"the recording is not written after {timeout:g} s")
        if self.failure:
            raise FlexvizError(self.failure)
        return self._written

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # -- the thread ----------------------------------------------------------------------------------

    def _put(self, piece: Callable[[], object]) -> None:
        with self._lock:
            if not self._closed and not self.failure:
                self._queue.put(piece)

    def _flush(self, what: str, share: float) -> None:
        """Write what is done of a long piece."""
        self._recorder.flush()

    def _work(self) -> None:
        flushed, dirty = time.monotonic(), False
        try:
            while True:
                try:
                    piece = self._queue.get(timeout=FLUSH_INTERVAL if dirty else None)
                except queue.Empty:
                    piece = self._recorder.flush
                if piece is None:
                    break
                piece()
                dirty = piece != self._recorder.flush
                if dirty and time.monotonic() - flushed > FLUSH_INTERVAL:
                    self._stream.flush()  # iterations still being gathered stay in memory
                    flushed = time.monotonic()
            self._recorder.flush()
            self._stream.close()
            if self._target is not None:
                self._written = self._target.finish(self._stream.entities, self._recorder.layout())
        except Exception as error:
            self._fail(error)

    def _fail(self, error: Exception) -> None:
        if not isinstance(error, FlexvizError | OSError):
            traceback.print_exc()
        reason = one_line(
            str(error) if isinstance(error, FlexvizError) else f"{type(error).__name__}: {error}"
        )
        with self._lock:
            self.failure = f"the recording has ended: {reason}"
            while not self._queue.empty():  # it will not be written
                self._queue.get_nowait()
        try:
            self._stream.close()
        except Exception:
            traceback.print_exc()
        if self._on_failure is not None:
            self._on_failure(self.failure)
