"""`flexviz report SET|SESSION --out FILE.html`: a report in one file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flexviz.cli.diagnose import GuardOption
from flexviz.cli.options import EffectsFromOption, load_effect_files


def report(
    source: Annotated[
        Path, typer.Argument(metavar="SET|SESSION", help="Folder with measurements.toml or session.json.")
    ],
    out: Annotated[Path, typer.Option(metavar="FILE", help="File to write: .html, .md or .json.")],
    guard: GuardOption = None,
    keep: Annotated[
        Path | None,
        typer.Option("--session", metavar="DIR", help="Also save the results as a session to a new folder."),
    ] = None,
    effects_from: EffectsFromOption = None,
) -> int:
    """Write a report on a set, after a full diagnosis, or on a saved session."""
    from flexviz.cli import output
    from flexviz.cli.progress import Reporter, interruptible, note
    from flexviz.workflows import report_kind, write_report

    load_effect_files(effects_from)
    report_kind(out)
    output.check_output_file(out)
    with Reporter(f"reading {source}") as progress, interruptible() as should_stop:
        done = write_report(source, out, guard=guard, keep=keep, progress=progress, should_stop=should_stop)
    if done.changed:
        note(f"the data have changed since the session was saved: {', '.join(done.changed)}")
    output.results().print(f"{out}: {out.stat().st_size / 1e3:.0f} kB", soft_wrap=True)
    diagnosis = done.session.analysis.diagnosis
    return 130 if diagnosis is not None and diagnosis.stopped else 0
