"""A session as a recording: every result and verdict on its way, as the history holds them."""

from __future__ import annotations

from pathlib import Path

from flexviz.measurements import MeasurementSet
from flexviz.progress import ProgressCallback
from flexviz.recording.files import Recorded
from flexviz.recording.writing import RecordingFile, chosen_observer, ending_tidily
from flexviz.session import Session


def record_session(
    session: Session, measurements: MeasurementSet, out: str | Path, progress: ProgressCallback | None = None
) -> Recorded:
    """Write a session to the file `out`; of the newest result the motion is simulated too."""
    steps = session.steps
    with RecordingFile(measurements, out, progress=progress) as file, ending_tidily():
        recorder = file.recorder
        recorder.begin(file.part(0.0, 0.15))
        newest = steps[-1].analysis.identification
        recorder.observe(chosen_observer(newest), file.part(0.15, 0.35))
        recorder.session(
            observer=steps[-1].analysis.observer,
            effects=list(steps[-1].analysis.effects),
            steps=[step.label for step in steps],
            notes=[note.text for note in session.notes],
        )
        results: list[int] = []
        verdicts: list[int] = []
        for step in steps:
            recorder.note(step.label)
            result, diagnosis = step.analysis.identification, step.analysis.diagnosis
            if result is not None and id(result) not in results:
                results.append(id(result))
                effects = ", ".join(step.analysis.effects)
                recorder.result(result, f"with {effects}" if effects else "as it is")
            if diagnosis is not None and id(diagnosis) not in verdicts:
                verdicts.append(id(diagnosis))
                recorder.diagnosis(diagnosis, [stair.step for stair in step.analysis.model_steps])
            file.step(step.label, 0.4)
        for note in session.notes:
            recorder.note(note.text)
        if newest is not None:
            file.simulate(newest, file.part(0.45, 1.0))
        file.step("writing", 1.0)
    assert file.written is not None
    return file.written
