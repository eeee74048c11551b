"""One file for one analysis: a recording that is begun, filled and ended in order, whatever happens."""

from __future__ import annotations

import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from flexviz.errors import Cancelled, ConvergenceError, InputError
from flexviz.measurements import MeasurementSet
from flexviz.observers import Observer, make_observer
from flexviz.progress import Progress, ProgressCallback, StopCallback
from flexviz.recording.files import Recorded, Target
from flexviz.recording.recorder import SAMPLES, Check, Recorder
from flexviz.recording.stream import Stream

if TYPE_CHECKING:
    from flexviz.diagnosis import Diagnosis
    from flexviz.identification import Identification
    from flexviz.progress import Iteration


class RecordingFile:
    """A file that is being recorded, as a context manager; `written` says afterwards what it holds.

    Left in order it is whole. Left by Cancelled, Ctrl+C or SIGTERM it is ended and kept as it is, marked as
    incomplete. Left by another error it is removed. A program that is killed leaves what was flushed: every
    step of the recording is.
    """

    def __init__(
        self,
        measurements: MeasurementSet,
        out: str | Path,
        *,
        samples: int = SAMPLES,
        both: bool = True,
        progress: ProgressCallback | None = None,
        should_stop: StopCallback | None = None,
    ) -> None:
        """`both`: leave room for the identified robot; the others as of `record_set`."""
        self.measurements = measurements
        self.written: Recorded | None = None
        self._progress = progress
        self._should_stop = should_stop
        self._target = Target(Path(out))
        self._stream = Stream(measurements.name, self._target)
        self.recorder = Recorder(measurements, self._stream, samples, both)
        self._started = 0.0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool:
        asked = isinstance(error, Cancelled | KeyboardInterrupt | SystemExit)
        try:
            if error is None:
                self.recorder.flush()
            self._stream.close()
            if error is None or asked:
                self.written = self._target.finish(
                    self._stream.entities, self.recorder.layout(), complete=error is None
                )
        except OSError as wrong:
            raise InputError(
                f"cannot be written ({wrong.strerror or wrong})", file=self._target.part
            ) from None
        if self.written is None:
            self._target.abandon()
        return isinstance(error, Cancelled)

    def step(self, what: str, share: float) -> None:
        """Something is done: it is flushed, told, and the user may stop.

        Raises
        ------
        Cancelled: the user has stopped it.
        """
        self.recorder.flush()
        if self._should_stop is not None and self._should_stop():
            raise Cancelled("stopped by the user")
        if self._progress is not None:
            self._progress(Progress(what, min(share, 1.0)))

    def part(self, first: float, last: float) -> Check:
        """`step` for a part of the work that goes from the share `first` to `last` of all of it."""
        return lambda what, share: self.step(what, first + (last - first) * share)

    def started(self, label: str = "") -> None:
        """A solve begins."""
        self._started = time.monotonic()
        self.recorder.start(label)

    def iteration(self, iteration: Iteration) -> None:
        """One iteration of it."""
        self.recorder.iteration(iteration, time.monotonic() - self._started)

    def simulate(self, result: Identification, check: Check) -> None:
        """The newest result's model, simulated along every group."""
        from flexviz.simulation import replay

        measurements = self.measurements
        for number, group in enumerate(measurements.groups):
            what, count = f"{group.name}: simulating the identified model", len(measurements.groups)

            def tell(news: Progress, number: int = number, what: str = what, count: int = count) -> None:
                check(what, (number + (news.share or 0.0)) / count)

            tell(Progress())
            try:
                run = replay(
                    measurements.robot,
                    result.model,
                    group,
                    measurements.kp,
                    measurements.kd,
                    torque_hold=measurements.torque_hold,
                    progress=tell,
                    should_stop=self._should_stop,
                )
            except ConvergenceError as error:  # a bad model may diverge: everything else is worth seeing
                self.recorder.no_run(group.name, str(error))
                continue
            self.recorder.run(group.name, run)


def record_set(
    measurements: MeasurementSet,
    identification: Identification | None,
    out: str | Path,
    observer: Observer | None = None,
    progress: ProgressCallback | None = None,
    should_stop: StopCallback | None = None,
    samples: int = SAMPLES,
    diagnosis: Diagnosis | None = None,
    label: str = "",
) -> Recorded:
    """Record a measurement set and what was found from it in the file `out`.

    Parameters
    ----------
    identification: its residuals, iterations and simulated motion are recorded; None: only what was measured.
    observer: whose states are recorded; None: the identification's, or the default one.
    progress: called as parts are recorded.
    should_stop: when it says so, what was recorded until then is kept; `complete` is False.
    samples: recorded at most of each signal and group.
    diagnosis: a verdict that belongs to it.
    label: what the identified model is, in a few words.
    """
    with (
        RecordingFile(
            measurements,
            out,
            samples=samples,
            both=identification is not None,
            progress=progress,
            should_stop=should_stop,
        ) as file,
        ending_tidily(),
    ):
        file.recorder.begin(file.part(0.0, 0.15))
        file.recorder.observe(observer or chosen_observer(identification), file.part(0.15, 0.35))
        if identification is not None:
            file.recorder.result(identification, label)
        if diagnosis is not None:
            file.recorder.diagnosis(diagnosis)
        if identification is not None:
            file.simulate(identification, file.part(0.4, 1.0))
        file.step("writing", 1.0)
    assert file.written is not None
    return file.written


def chosen_observer(identification: Identification | None) -> Observer:
    """The identification's observer, or the default one."""
    if identification is None:
        return make_observer("butterworth-zero-phase")
    return make_observer(identification.observer_name, identification.bandwidth)  # type: ignore[arg-type]


@contextmanager
def ending_tidily() -> Iterator[None]:
    """Let a request to terminate (SIGTERM) unwind the program, so that the recording is ended in order."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous = signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, previous)
