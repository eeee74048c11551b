"""`flexviz record SET --out FILE.rrd`: everything about one analysis as a Rerun recording."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flexviz.cli.identifying import (
    BandwidthOption,
    EffectOption,
    GroupOption,
    ObserverOption,
    RefineOption,
    SetArgument,
    Wanted,
    exit_code,
    identify_wanted,
    parse_bandwidth,
    read_wanted,
)
from flexviz.cli.own import EffectsFromOption, load_own
from flexviz.errors import Cancelled

if TYPE_CHECKING:
    from flexviz.cli.progress import Reporter
    from flexviz.diagnosis import Diagnosis
    from flexviz.identification import Identification
    from flexviz.measurements import MeasurementSet
    from flexviz.recording import RecordingFile

Stop = Callable[[], bool]


def record(
    measurement_set: SetArgument,
    out: Annotated[Path, typer.Option(metavar="FILE.rrd", help="File to write.")],
    group: GroupOption = None,
    effect: EffectOption = None,
    observer: ObserverOption = "butterworth-zero-phase",
    bandwidth: BandwidthOption = None,
    refine: RefineOption = False,
    diagnose: Annotated[
        bool,
        typer.Option(
            "--diagnose",
            help="Also look for what is missing, add it effect by effect, and record every step.",
        ),
    ] = False,
    effects_from: EffectsFromOption = None,
) -> int:
    """Identify, and record signals, observer states, residuals, iterations and both robots as it goes on."""
    from flexviz.cli import output
    from flexviz.cli.progress import Reporter, interruptible
    from flexviz.recording import RecordingFile, ending_tidily
    from flexviz.results import run_lines

    load_own(effects_from)
    output.check_output_file(out, ".rrd")
    wanted = Wanted(measurement_set, group or [], effect or [], observer, parse_bandwidth(bandwidth), refine)
    results: list[Identification] = []
    with Reporter(f"reading {measurement_set}") as report, interruptible("the recording is kept") as stop:
        measurements = read_wanted(wanted)

        file = RecordingFile(measurements, out, progress=report, should_stop=stop)
        with file, ending_tidily():
            record_all(file, wanted, diagnose, report, stop, results)
    written = file.written
    assert written is not None
    console = output.results()
    if results:
        for line in run_lines(results[-1].document()):
            console.print(line, soft_wrap=True)
    state = "" if written.complete else ", stopped before everything was recorded"
    size = f"{written.bytes / 1e6:.1f} MB, {written.chunks} chunks"
    console.print(f"{written.file}: {size}{state}", soft_wrap=True)
    return exit_code(results[-1]) if written.complete else 130


def record_all(
    file: RecordingFile,
    wanted: Wanted,
    diagnose: bool,
    report: Reporter,
    stop: Stop,
    results: list[Identification],
) -> None:
    """Record a set, its identification and, with `diagnose`, the way to the model that lacks nothing."""
    from flexviz.diagnosis import maps_of
    from flexviz.observers import make_observer

    measurements = file.measurements
    file.recorder.begin(file.part(0.0, 0.1))
    file.recorder.session(
        observer=wanted.observer,
        effects=wanted.effects,
        groups=wanted.groups,
        refine=wanted.refine,
        diagnose=diagnose,
    )
    file.recorder.observe(make_observer(wanted.observer, wanted.bandwidth), file.part(0.1, 0.25))

    def solve(effects: list[str], label: str) -> None:
        file.recorder.start(label)
        asked = replace(wanted, effects=effects)
        result = identify_wanted(measurements, asked, report, stop, file.recorder.iteration)
        file.recorder.result(result)
        results.append(result)
        if result.stopped:
            raise Cancelled("stopped by the user")
        file.step(f"{label}: where it fails", 0.3)
        file.recorder.maps(maps_of(measurements, result.model, effects))

    effects = wanted.effects
    solve(effects, f"with {', '.join(effects)}" if effects else "as it is")
    if diagnose:
        found = search(measurements, effects, report, stop)
        file.recorder.diagnosis(found)
        if found.stopped:
            raise Cancelled("stopped by the user")
        for step in found.steps:
            if step.added is not None:
                effects = [*effects, step.added.text]
                solve(effects, f"+ {step.added.text}")
    file.simulate(results[-1], file.part(0.5, 1.0))
    file.step("writing", 1.0)


def search(measurements: MeasurementSet, effects: list[str], report: Reporter, stop: Stop) -> Diagnosis:
    """Look for what is missing beside these effects, and add it."""
    from flexviz.diagnosis import diagnose

    return diagnose(
        replace(measurements, effects=(*measurements.effects, *effects)),
        apply=True,
        progress=report,
        should_stop=stop,
    )
