"""A session on the small set that holds everything a session can hold."""

from __future__ import annotations

from pathlib import Path

from flexviz.analysis.identification import identify
from flexviz.content.session import Session
from flexviz.data.measurements import MeasurementSet, read_set
from tests.found import DIAGNOSIS
from tests.small_set import write_small_set


def small_session(folder: Path) -> tuple[MeasurementSet, Session]:
    """The set in `folder`, and a session: identified, diagnosed, an effect added, one step undone."""
    measurements = read_set(write_small_set(folder))
    session = Session.of(measurements)
    result = identify(measurements, max_iterations=2, refine=False)
    analysis = session.analysis.with_identification(result, session.analysis.settings)
    session = session.then("identified", analysis)
    session = session.then("looked", analysis.with_diagnosis(DIAGNOSIS))
    session = session.then("offset", session.analysis.with_effects(["torque_offset:joint1"]))
    return measurements, session.then("width", session.analysis.with_fit(bandwidth=(30.0, 40.0))).undo()
