"""A recording that grows with an analysis.

    recording = LiveRecording(measurements, "demo.rrd")
    recording.observer(make_observer("butterworth-zero-phase"))
    recording.started("with Coulomb friction")                     # start of a solve
    result = identify(measurements, progress=recording.progress)  # every iteration
    recording.identified(result)
    recording.replayed("g1", run)                                  # the identified model's simulated motion
    recording.diagnosed(diagnosis)
    recording.close()

All calls except `flush` and `close` only queue their content; one thread writes the queue in order and
flushes within a second. Flushed content survives a crash of the program.
"""

from __future__ import annotations

import queue
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial, wraps
from pathlib import Path
from typing import Concatenate, ParamSpec

from flexviz.base.errors import FlexvizError, InputError, one_line
from flexviz.base.iteration import Iteration
from flexviz.base.progress import Progress
from flexviz.data.measurements import MeasurementSet
from flexviz.outlets.recording.files import Target
from flexviz.outlets.recording.reading import Recorded
from flexviz.outlets.recording.recorder import MAX_SAMPLES, Recorder
from flexviz.outlets.recording.stream import Stream

FLUSH_INTERVAL = 1.0  # [s] between two flushes
WRITE_TIMEOUT = 120.0  # [s] limit of `flush` and `close`


P = ParamSpec("P")


def queued(
    method: Callable[Concatenate[Recorder, P], object],
) -> Callable[Concatenate[LiveRecording, P], None]:
    """A method of `Recorder` as one of `LiveRecording`, which queues it."""

    @wraps(method)
    def put(self: LiveRecording, *args: P.args, **more: P.kwargs) -> None:
        self.put(partial(method, self.recorder, *args, **more))

    return put


class LiveRecording(AbstractContextManager["LiveRecording"]):
    """A growing recording of one measurement set; thread-safe.

    A failure (full disk, result of another set) ends the recording and is passed to `on_failure`; `flush`
    and `close` raise it.

    Attributes:
        recorder: what is queued calls its methods, from the recording's thread.
        failure: why the recording has ended, or "".
    """

    def __init__(
        self,
        measurements: MeasurementSet,
        file: str | Path,
        *,
        samples: int = MAX_SAMPLES,
        on_failure: Callable[[str], None] | None = None,
    ) -> None:
        """Open the recording and record the measured signals and robot.

        Args:
            measurements: the set.
            file: the recording. An existing file is replaced by `close`; until then `file` is beside it.
            samples: upper limit per signal and group.
            on_failure: called once, from the recording's thread, with a one-line reason.

        Raises:
            InputError: the file's folder does not exist.
        """
        self.failure = ""
        self._on_failure = on_failure
        self.recorder = Recorder(measurements, Stream(measurements.name, Target(Path(file))), samples)
        self._queue: queue.Queue[Callable[[], object] | None] = queue.Queue()
        self._begun = time.monotonic()
        self._lock = threading.Lock()
        self._closed = False
        self._written: Recorded | None = None
        self.put(self.recorder.measured)
        self._thread = threading.Thread(target=self._work, name="flexviz-recording", daemon=True)
        self._thread.start()

    @property
    def file(self) -> Path:
        """Where it is written at present."""
        return self.recorder.stream.target.part

    observer = queued(Recorder.observe)
    """Record all states of an observer, once."""
    identified = queued(Recorder.result)
    """Record a result with residuals and parameters; `label` describes its model."""
    replayed = queued(Recorder.run)
    """Record the newest result's model, simulated in a group, with its robot."""
    mapped = queued(Recorder.maps)
    """Record where the newest result's model fails."""
    diagnosed = queued(Recorder.diagnosis)
    """Record a diagnosis; `steps` replaces its own model steps."""
    note = queued(Recorder.note)
    """Add a line to the log."""

    def started(self, label: str = "") -> None:
        """Start a solve: later iterations and the next result belong to it."""
        self._begun = time.monotonic()
        self.put(partial(self.recorder.start, label))

    def progress(self, news: Progress) -> None:
        """Record the iterations of the running solve; a progress callback for `identify`."""
        if news.iteration is not None:
            self.iteration(news.iteration)

    def iteration(self, iteration: Iteration) -> None:
        """Record an iteration of the running solve."""
        self.put(partial(self.recorder.iteration, iteration, time.monotonic() - self._begun))

    # -- its end -------------------------------------------------------------------------------------

    def flush(self, timeout: float = WRITE_TIMEOUT) -> None:
        """Wait until everything queued is in the file.

        Raises:
            FlexvizError: the recording has failed, or takes longer than `timeout` [s].
        """
        done = threading.Event()
        self.put(lambda: (self.recorder.flush(), done.set()))
        end = time.monotonic() + timeout
        while not done.wait(0.05) and not self.failure and time.monotonic() < end:
            pass
        self._check(done.is_set(), timeout)

    def close(self, timeout: float = WRITE_TIMEOUT) -> Recorded:
        """Write the rest, check the file and move it into place.

        Raises:
            FlexvizError: the recording has failed, or takes longer than `timeout` [s].
        """
        with self._lock:
            closed, self._closed = self._closed, True
        if not closed:
            self._queue.put(None)
        self._thread.join(timeout)
        self._check(not self._thread.is_alive(), timeout)
        assert self._written is not None
        return self._written

    def _check(self, done: bool, timeout: float) -> None:
        if self.failure:
            raise FlexvizError(self.failure)
        if not done:
            raise FlexvizError(f"writing the recording took longer than {timeout:g} s")

    def __exit__(self, *error: object) -> None:
        self.close()

    # -- the thread ----------------------------------------------------------------------------------

    def put(self, piece: Callable[[], object]) -> None:
        """Queue a piece of work, unless the recording has ended."""
        with self._lock:
            if not self._closed and not self.failure:
                self._queue.put(piece)

    def _work(self) -> None:
        flushed, dirty = time.monotonic(), False
        try:
            while True:
                try:
                    piece = self._queue.get(timeout=FLUSH_INTERVAL if dirty else None)
                except queue.Empty:
                    piece = self.recorder.flush
                if piece is None:
                    break
                piece()
                dirty = piece != self.recorder.flush
                if dirty and time.monotonic() - flushed > FLUSH_INTERVAL:
                    self.recorder.stream.flush()  # without the iterations of the current batch
                    flushed = time.monotonic()
            self._written = self.recorder.finish()
        except Exception as error:
            self._fail(error)

    def _fail(self, error: Exception) -> None:
        if not isinstance(error, FlexvizError | OSError):
            traceback.print_exc()
        reason = one_line(
            str(error) if isinstance(error, FlexvizError) else f"{type(error).__name__}: {error}"
        )
        with self._lock:
            self.failure = f"the recording has stopped: {reason}"
            while not self._queue.empty():  # nothing more is written
                self._queue.get_nowait()
        try:
            self.recorder.stream.close()
        except InputError:
            pass  # the same failure once more
        except Exception:
            traceback.print_exc()
        if self._on_failure is not None:
            self._on_failure(self.failure)
