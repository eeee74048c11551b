"""Write one recording: all of it or nothing."""

from __future__ import annotations

import os
import signal
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import rerun as rr

from flexviz.errors import Cancelled, ConvergenceError, InputError
from flexviz.measurements import Group, MeasurementSet
from flexviz.observers import Observer, make_observer
from flexviz.recording import signals
from flexviz.recording.checking import check_recording, sidecar
from flexviz.recording.columns import stride_for
from flexviz.recording.layout import blueprint
from flexviz.recording.paths import APPLICATION, SUMMARY, group_path
from flexviz.recording.scene import Stage, send_robots, set_stage
from flexviz.recording.texts import group_text, summary_text
from flexviz.view.geometry import Shape, robot_shape
from flexviz.view.motion import Motion, measured_motion, with_replay

if TYPE_CHECKING:
    from flexviz.identification import Identification

SAMPLES = 10_000  # recorded at most of each signal and group
Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Recorded:
    """What was written.

    Attributes
    ----------
    file: the recording.
    bytes: its size.
    chunks: how many chunks it holds, read back.
    sha256: of the file; also beside it in `<file>.sha256`.
    """

    file: Path
    bytes: int
    chunks: int
    sha256: str


def record_set(
    measurements: MeasurementSet,
    identification: Identification | None,
    out: str | Path,
    observer: Observer | None = None,
    progress: Progress | None = None,
    should_stop: Callable[[], bool] | None = None,
    samples: int = SAMPLES,
) -> Recorded:
    """Record a measurement set and what was identified from it in the file `out`.

    Parameters
    ----------
    identification: its residuals, iterations and simulated motion are recorded; None: only what was measured.
    observer: whose states are recorded; None: the identification's, or the default one.
    progress: is told what is being done and the share (0 … 1) of everything that is done.
    should_stop: when it says so, nothing is written and Cancelled is raised.
    samples: recorded at most of each signal and group.
    """
    file = Path(out)
    check_target(file)
    if observer is None:
        observer = chosen_observer(identification)
    writer = Writer(measurements, identification, observer, progress, should_stop, samples)
    descriptor, name = tempfile.mkstemp(prefix=f".{file.name}.", suffix=".part", dir=file.absolute().parent)
    os.close(descriptor)
    part = Path(name)
    try:
        with ending_tidily():
            writer.write(part)
        checked = check_recording(part)
        if missing := writer.entities - set(checked.entities):
            raise OSError(f"{len(missing)} entities were not written, {min(missing)} among them")
        umask = os.umask(0)
        os.umask(umask)
        part.chmod(0o666 & ~umask)
        sidecar(file).unlink(missing_ok=True)
        os.replace(part, file)
        sidecar(file).write_text(f"{checked.sha256}  {file.name}\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror or error})", file=file) from None
    finally:
        part.unlink(missing_ok=True)
    return Recorded(file, file.stat().st_size, checked.chunks, checked.sha256)


@contextmanager
def ending_tidily() -> Iterator[None]:
    """Let a request to terminate (SIGTERM) unwind the program, so that nothing half written stays."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous = signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, previous)


def check_target(file: Path) -> None:
    """Say before the work that `file` cannot be written."""
    if file.is_dir():
        raise InputError("is a folder; the name of a file, *.rrd, would be right", file=file)
    if not file.absolute().parent.is_dir():
        raise InputError(f"the folder {file.absolute().parent} does not exist", file=file)


def chosen_observer(identification: Identification | None) -> Observer:
    """The identification's observer, or the default one."""
    if identification is None:
        return make_observer("butterworth-zero-phase")
    return make_observer(identification.observer_name, identification.bandwidth)  # type: ignore[arg-type]


class Writer:
    """Sends everything to a Rerun file, group by group."""

    def __init__(
        self,
        measurements: MeasurementSet,
        identification: Identification | None,
        observer: Observer,
        progress: Progress | None,
        should_stop: Callable[[], bool] | None,
        samples: int,
    ) -> None:
        self.measurements = measurements
        self.identification = identification
        self.observer = observer
        self.samples = samples
        self.entities: set[str] = set()
        self._progress = progress
        self._should_stop = should_stop

    def write(self, file: Path) -> None:
        """Write the whole recording to `file`."""
        measurements, result = self.measurements, self.identification
        self._step("reading the robot's shape", 0.0)
        shape = robot_shape(measurements.robot)
        stage = set_stage(measurements, shape, both=result is not None)
        layout = blueprint(
            measurements,
            stage,
            simulated=[] if result is None else [group.name for group in measurements.groups],
            residuals=[] if result is None else list(result.residuals),
            parameters=[] if result is None else signals.parameter_names(result),
            disturbance=self.observer.name.startswith("eso"),
        )
        title = measurements.name + (" (simulated data)" if measurements.simulated else "")
        with rr.RecordingStream(APPLICATION) as recording:
            recording.save(file, default_blueprint=layout)
            recording.send_recording_name(title)
            recording.send_property(
                "flexviz",
                rr.AnyValues(
                    set=measurements.name,
                    simulated=measurements.simulated,
                    observer=self.observer.name,
                    groups=[group.name for group in measurements.groups],
                ),
            )
            self._text(recording, SUMMARY, summary_text(measurements, result, self.observer))
            if result is not None:
                signals.send_optimiser(recording, result)
            for number, group in enumerate(measurements.groups):
                self._group(recording, shape, stage, group, number / len(measurements.groups))
            self._step("writing", 1.0)

    def _group(
        self, recording: rr.RecordingStream, shape: Shape, stage: Stage, group: Group, done: float
    ) -> None:
        measurements, result = self.measurements, self.identification
        share = 1.0 / len(measurements.groups)
        self._step(f"{group.name}: states", done)
        signals.send_measured(recording, measurements, group, self.samples)
        signals.send_states(recording, measurements, group, self.observer, self.samples)
        motion = measured_motion(measurements, group, result)
        if result is not None:
            signals.send_identification(recording, measurements, group, result)
            motion = self._simulated(recording, group, motion, result, done + 0.2 * share, 0.7 * share)
        self._step(f"{group.name}: motion", done + 0.9 * share)
        send_robots(recording, measurements, shape, stage, group, motion)
        stride = stride_for(group.samples, self.samples)
        self._text(
            recording, group_path(group.name, "about"), group_text(measurements, group, motion, stride)
        )

    def _simulated(
        self,
        recording: rr.RecordingStream,
        group: Group,
        motion: Motion,
        result: Identification,
        done: float,
        share: float,
    ) -> Motion:
        """The motion with the identified model's own beside it, which is simulated and sent."""
        from flexviz.simulation import replay

        measurements = self.measurements
        what = f"{group.name}: simulating the identified model"
        try:
            run = replay(
                measurements.robot,
                result.model,
                group,
                measurements.kp,
                measurements.kd,
                torque_hold=measurements.torque_hold,
                progress=lambda part: self._step(what, done + share * part),
                should_stop=self._should_stop,
            )
        except ConvergenceError as error:  # a bad model may diverge: everything else is still worth seeing
            return replace(motion, model_note=f"none: {error}")
        signals.send_run(recording, measurements, group, run, self.samples)
        return with_replay(motion, run)

    def _text(self, recording: rr.RecordingStream, entity: str, text: str) -> None:
        recording.log(entity, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)
        self.entities.add(entity)

    def _step(self, what: str, share: float) -> None:
        if self._should_stop is not None and self._should_stop():
            raise Cancelled("stopped by the user; nothing was written")
        if self._progress is not None:
            self._progress(what, min(share, 1.0))
