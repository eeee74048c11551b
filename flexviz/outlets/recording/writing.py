"""Record a measurement set or a session into a file, which is always closed properly."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from flexviz.analysis.diagnosis import Diagnosis
from flexviz.analysis.identification import Identification
from flexviz.base.errors import Cancelled, ConvergenceError, InputError
from flexviz.base.progress import Progress, ProgressCallback, StopCallback, ignore, never
from flexviz.content.session import Session
from flexviz.data.measurements import MeasurementSet
from flexviz.model.observers import Observer, make_observer
from flexviz.model.simulation import Run
from flexviz.outlets.recording.files import Target
from flexviz.outlets.recording.reading import Recorded
from flexviz.outlets.recording.recorder import MAX_SAMPLES, Check, Recorder
from flexviz.outlets.recording.stream import Stream


@contextmanager
def ending_tidily() -> Iterator[None]:
    """Turn SIGTERM into SystemExit, so that a recording is closed properly."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous = signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, previous)


@dataclass(eq=False)
class RecordingFile:
    """An open recording file; `written` describes the finished file."""

    recorder: Recorder
    progress: ProgressCallback
    should_stop: StopCallback
    written: Recorded | None = None

    def step(self, what: str, share: float) -> None:
        """Flush and report progress; raises Cancelled when stopped."""
        self.recorder.flush()
        if self.should_stop():
            raise Cancelled
        self.progress(Progress(what, min(share, 1.0)))

    def part(self, first: float, last: float) -> Check:
        """`step` scaled to the shares `first` to `last` of the work."""
        return lambda what, share: self.step(what, first + (last - first) * share)

    def simulate(self, result: Identification, check: Check) -> None:
        """Record the newest result's model, simulated in every group."""
        from flexviz.model import simulation

        measurements = self.recorder.measurements
        count = len(measurements.groups)
        for number, group in enumerate(measurements.groups):
            what = f"{group.name}: simulating the identified model"

            def tell(news: Progress, number: int = number, what: str = what) -> None:
                check(what, (number + (news.share or 0.0)) / count)

            tell(Progress())
            try:
                run = simulation.replay(
                    measurements.robot,
                    result.model,
                    group,
                    measurements.kp,
                    measurements.kd,
                    torque_hold=measurements.torque_hold,
                    progress=tell,
                    should_stop=self.should_stop,
                )
            except ConvergenceError as error:  # a poor model may diverge
                self.recorder.no_run(group.name, str(error))
                continue
            self.recorder.run(group.name, run)


@contextmanager
def recording_file(
    measurements: MeasurementSet,
    out: str | Path,
    *,
    samples: int = MAX_SAMPLES,
    both: bool = True,
    progress: ProgressCallback = ignore,
    should_stop: StopCallback = never,
) -> Iterator[RecordingFile]:
    """Open a recording; `both` leaves room for the identified robot, other arguments as in `record_set`.

    After Cancelled, which is suppressed, Ctrl+C or SIGTERM the file is closed and kept, marked as incomplete;
    after another error it is removed. If the program is killed, everything up to the last `step` remains.
    """
    target = Target(Path(out))
    recorder = Recorder(measurements, Stream(measurements.name, target), samples, both)
    file = RecordingFile(recorder, progress, should_stop)
    try:
        with ending_tidily():
            yield file
    except (Cancelled, KeyboardInterrupt, SystemExit) as error:
        file.written = recorder.finish(complete=False)
        if not isinstance(error, Cancelled):
            raise
    except BaseException:
        with suppress(InputError):
            recorder.stream.close()
        target.now.unlink(missing_ok=True)
        raise
    else:
        file.written = recorder.finish()


def record_set(
    measurements: MeasurementSet,
    identification: Identification | None,
    out: str | Path,
    observer: Observer | None = None,
    progress: ProgressCallback = ignore,
    should_stop: StopCallback = never,
    samples: int = MAX_SAMPLES,
    diagnosis: Diagnosis | None = None,
    label: str = "",
) -> Recorded:
    """Write a measurement set and its results to the file `out`.

    Args:
        identification: the result; None records measurements only.
        observer: the recorded states; None uses the identification's observer, or the default.
        progress: called for every part.
        should_stop: stops the recording; the file is kept with `complete` False.
        samples: upper limit per signal and group.
        diagnosis: of the identification.
        label: short description of the identified model.
    """
    both = identification is not None
    options = {"samples": samples, "both": both, "progress": progress, "should_stop": should_stop}
    with recording_file(measurements, out, **options) as file:
        file.recorder.measured(file.part(0.0, 0.15))
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


def record_session(
    session: Session,
    measurements: MeasurementSet,
    out: str | Path,
    progress: ProgressCallback = ignore,
    should_stop: StopCallback = never,
    runs: Mapping[str, Run] | None = None,
) -> Recorded:
    """Write a session with all results of its history to the file `out`; only the newest is simulated.

    With `runs`, group → the newest model's simulated motion, those are written instead, and nothing is
    simulated. When stopped the file is kept with `complete` False.
    """
    steps = session.steps
    with recording_file(measurements, out, progress=progress, should_stop=should_stop) as file:
        recorder = file.recorder
        recorder.measured(file.part(0.0, 0.15))
        newest = steps[-1].analysis.identification
        recorder.observe(chosen_observer(newest), file.part(0.15, 0.35))
        recorder.session(
            observer=steps[-1].analysis.fit.observer,
            effects=list(steps[-1].analysis.effects),
            steps=[step.label for step in steps],
            notes=[note.text for note in session.notes],
        )
        recorded: set[int] = set()  # ids: a step keeps the results of the one before
        for step in steps:
            recorder.note(step.label)
            result, diagnosis = step.analysis.identification, step.analysis.diagnosis
            if result is not None and id(result) not in recorded:
                effects = ", ".join(step.analysis.effects)
                recorder.result(result, f"with {effects}" if effects else "present model")
            if diagnosis is not None and id(diagnosis) not in recorded:
                recorder.diagnosis(diagnosis, [one.step for one in step.analysis.model_steps])
            recorded |= {id(result), id(diagnosis)}
            file.step(step.label, 0.4)
        for note in session.notes:
            recorder.note(note.text)
        for group, run in (runs or {}).items():
            recorder.run(group, run)
            file.step(f"{group}: the simulated motion", 0.9)
        if newest is not None and runs is None:
            file.simulate(newest, file.part(0.45, 1.0))
        file.step("writing", 1.0)
    assert file.written is not None
    return file.written


def chosen_observer(identification: Identification | None) -> Observer:
    """The identification's observer, or the default one."""
    if identification is None:
        return make_observer("butterworth-zero-phase")
    return identification.observer
