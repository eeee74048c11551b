"""`flexviz verify`: whether a result keeps the limits that somebody has set for it."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flexviz.base.errors import InputError
from flexviz.outlets.terminal import terminal
from flexviz.outlets.terminal.options import JsonOption, SetArgument
from flexviz.outlets.terminal.terminal import Reporter, interruptible

if TYPE_CHECKING:
    from flexviz.analysis.acceptance import AcceptanceResult, AcceptanceScope
    from flexviz.content.results import ResultDocument
    from flexviz.data.measurements import MeasurementSet

NOT_MET = 1  # exit code


def verify(
    measurement_set: SetArgument,
    require: Annotated[
        Path, typer.Option(metavar="LIMITS.toml", help="Limits on held-out error, intervals and verdict.")
    ],
    result: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.json",
            help="Judge this result of the set, from diagnose --apply --json, instead of diagnosing anew.",
        ),
    ] = None,
    json_file: JsonOption = None,
) -> int:
    """Accept or refuse the model of a set by limits: exit code 0 if all are met, 1 if not."""
    from flexviz.analysis.acceptance import acceptance_scope, judge, read_limits
    from flexviz.content.topics import verified
    from flexviz.data.measurements import read_set

    terminal.check_output_file(json_file, ".json")
    with Reporter(f"reading {measurement_set}") as report, interruptible() as should_stop:
        measurements = read_set(measurement_set)
        limits = read_limits(require, measurements.joints)
        if result is None:
            from flexviz.analysis.diagnosis import diagnose

            told = diagnose(measurements, apply=True, progress=report, should_stop=should_stop).document()
        else:
            told = saved_result(result, measurements)
    if told.stopped:
        terminal.note("stopped: nothing is judged")
        return 130
    found, scope = judge(told, limits, measurements.joints), acceptance_scope(measurements)
    terminal.show_blocks(verified(found, scope))
    terminal.write_json(json_file, document(measurements, require, found, scope))
    return 0 if found.passed else NOT_MET


def saved_result(file: Path, measurements: MeasurementSet) -> ResultDocument:
    """A result file; InputError if it is of other data."""
    from flexviz.content.results import read_result
    from flexviz.data.measurements import fingerprint

    told = read_result(file)
    if told.set_sha256 is not None and told.set_sha256 != fingerprint(measurements).sha256:
        message = f"is a result of {told.set} with other data, expected one of {measurements.path}"
        raise InputError(message, file=file)
    if told.set_sha256 is None and told.set != measurements.name:
        raise InputError(f"is a result of {told.set}, expected one of {measurements.name}", file=file)
    return told


def document(
    measurements: MeasurementSet, require: Path, found: AcceptanceResult, scope: AcceptanceScope
) -> dict[str, Any]:
    """What `--json` writes."""
    from flexviz.analysis.acceptance import NOT_PROVED
    from flexviz.data.measurements import fingerprint

    return {
        "format": 1,
        "set": measurements.name,
        "set_sha256": fingerprint(measurements).sha256,
        "limits": require.name,
        **found.to_dict(),
        "scope": asdict(scope) | {"text": scope.text},
        "not_proved": [fact.text for fact in NOT_PROVED],
    }
