"""The robot of a session's present result."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from flexviz.base.errors import InputError
from flexviz.content.session import Analysis
from flexviz.data.measurements import MeasurementSet
from flexviz.outlets.exporting.identified import IdentifiedRobot, identified_robot


def session_robot(
    measurements: MeasurementSet,
    analysis: Analysis,
    *,
    changed: Sequence[str] = (),
    payload: str | None = None,
    file: str | Path = "the session",
) -> IdentifiedRobot:
    """The robot of a session's set with the model of its present result.

    Args:
        changed: names of the set's files that have changed since.
        file: the session, for error messages.

    Raises:
        InputError: there is no result, or see `identified_robot`.
    """
    diagnosis = analysis.diagnosis
    found = analysis.identification or diagnosis
    if found is None:
        raise InputError(
            "the session has no result, expected one with an identification, or the measurement set "
            f"{measurements.path}",
            file=file,
        )
    current = analysis.up_to_date if found is analysis.identification else analysis.diagnosis_up_to_date
    remarks = []
    if changed:
        remarks.append(f"Changed since these values were found: {', '.join(changed)}.")
    elif not current:
        remarks.append("The session's settings have been changed since these values were found.")
    fits = found is not diagnosis and analysis.diagnosis_up_to_date
    checked = diagnosis if fits else None
    return identified_robot(
        measurements, found, payload=payload, diagnosis=checked, file=file, remarks=remarks
    )
