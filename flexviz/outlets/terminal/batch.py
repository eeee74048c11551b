"""`flexviz batch` and `flexviz study`: many measurement sets, or many runs, in one table."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flexviz.base.errors import InputError
from flexviz.outlets.terminal import terminal
from flexviz.outlets.terminal.options import IdentificationOptions, WorkOptions
from flexviz.outlets.terminal.terminal import Reporter, interruptible

if TYPE_CHECKING:
    from flexviz.analysis.identification import FitSettings
    from flexviz.content.blocks import Block
    from flexviz.outlets.batch import BatchOutcome, StudyOutcome

OutOption = Annotated[
    Path, typer.Option(metavar="RESULTS", help="Folder for the results: new, or that of an earlier run.")
]


def batch(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="DIR|LIST",
            help="Folder that is searched for measurement sets, a text file with one per line, or a CSV file "
            "with the columns set and, if known, robot and date.",
        ),
    ],
    out: OutOption,
    options: IdentificationOptions,
    work: WorkOptions,
    diagnose: bool = typer.Option(
        True, "--diagnose/--no-diagnose", help="Look for missing effects, add them, and refit."
    ),
    limit: float = typer.Option(
        0.0,
        metavar="S",
        min=0.0,
        help="Time limit of a diagnosis in seconds; it keeps what it has found. 0: none.",
    ),
) -> int:
    """Identify and diagnose many measurement sets; go on where an earlier run ended."""
    from flexviz.outlets.batch import ClusterChoice, SetOptions, run_batch

    what = SetOptions(of_every_set(options), diagnosed=diagnose, limit=limit)
    where = ClusterChoice(work.workers, work.scheduler, work.patience)
    with Reporter(f"reading {source}") as report, interruptible("finished sets are kept") as should_stop:
        done = run_batch(
            source, out, what, where,
            retry=work.retry, progress=report, should_stop=should_stop, note=terminal.note,
        )  # fmt: skip
    terminal.print_lines(lines(done))
    if not done.complete:
        return 130
    return 1 if any(row.state == "failed" for row in done.rows) else 0


def of_every_set(options: IdentificationOptions) -> FitSettings:
    """How every set is identified; InputError for what only a single one can be told."""
    from flexviz.model.effects import named_effect

    if options.group or options.gains:
        name = "group" if options.group else "gains"
        raise InputError(f"--{name}: only of flexviz identify; here all sets are identified alike")
    settings = options.settings()
    for text in settings.effects:
        named_effect(text)
    return settings


def lines(done: BatchOutcome) -> list[str]:
    """Counts of states and verdicts, what repeats, and where the results are."""
    from flexviz.outlets.batch import counted_verdicts, repeatability, repeatability_lines

    out = [f"{len(done.rows)} sets: {counted_verdicts(done.rows)}", computed(done)]
    out += [f"failed: {row.set}: {row.error}" for row in done.rows if row.state == "failed"][:10]
    for robot in repeatability(done.rows)[:10]:
        out += repeatability_lines(robot)
    return [*out, f"{done.folder}: results.parquet, summary.html"]


def study(
    kind: Annotated[
        str, typer.Argument(metavar="KIND", help="monte-carlo, bootstrap, bandwidth or detection.")
    ],
    source: Annotated[
        str,
        typer.Argument(
            metavar="PRESET|URDF|SET",
            help="What is simulated, as in flexviz simulate; for bootstrap and bandwidth, a measurement set.",
        ),
    ],
    out: OutOption,
    options: IdentificationOptions,
    work: WorkOptions,
    runs: int = typer.Option(100, metavar="N", min=1, help="Number of seeds; for detection, per size."),
    at: list[float] | None = typer.Option(
        None, "--at", metavar="X", help="A bandwidth in rad/s, or a size of the effect; repeat for more."
    ),
    hide: list[str] | None = typer.Option(
        None, metavar="NAME[:joint][:param=value,...]", help="Hide an effect in the robot; repeat for more."
    ),
    parameter: str = typer.Option("", metavar="NAME", help="Parameter of the effect that --at varies."),
    start: str = typer.Option("rest", metavar="rest|moving", help="How a simulated motion starts."),
    block: float = typer.Option(2.0, metavar="S", help="Length of the blocks of a bootstrap, in s."),
    diagnose: bool = typer.Option(False, "--diagnose", help="Of monte-carlo: also diagnose each run."),
) -> int:
    """Repeat an analysis: noise seeds, resampled data, bandwidths, or sizes of a hidden effect."""
    from flexviz.outlets.batch import ClusterChoice, StudyPlan, run_study

    plan = StudyPlan(
        kind, source, runs, tuple(hide or ()), parameter, tuple(at or ()),
        fit=of_every_set(options), diagnosed=diagnose, start=start, block=block,
    )  # fmt: skip
    where = ClusterChoice(work.workers, work.scheduler, work.patience)
    with Reporter(f"study of {source}") as report, interruptible("finished runs are kept") as should_stop:
        done = run_study(
            plan, out, where, retry=work.retry, progress=report, should_stop=should_stop, note=terminal.note
        )
    terminal.show_blocks(study_blocks(done))
    return 130 if not done.complete else 1 if done.count.failed else 0


def computed(done: BatchOutcome | StudyOutcome) -> str:
    """How much was computed now."""
    return f"computed now: {done.count.done}; kept from before: {done.count.kept}"


def study_blocks(done: StudyOutcome) -> list[Block]:
    """What the runs say together, and where the results are."""
    from flexviz.content.blocks import Paragraph
    from flexviz.outlets.batch import study_sections

    said = [block for section in study_sections(done.plan, done.runs) for block in section.blocks]
    return [*said, Paragraph(computed(done)), Paragraph(f"{done.folder}: runs.parquet, summary.html")]
