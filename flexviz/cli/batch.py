"""`flexviz batch`: many measurement sets, one table."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flexviz.cli import terminal
from flexviz.cli.options import IdentificationOptions, parse_bandwidth
from flexviz.cli.terminal import Reporter, interruptible
from flexviz.errors import InputError

if TYPE_CHECKING:
    from flexviz.batch import BatchOutcome

OutOption = Annotated[
    Path, typer.Option(metavar="RESULTS", help="Folder for the results: new, or that of an earlier run.")
]
WorkersOption = Annotated[int, typer.Option(metavar="N", min=1, help="Local processes.")]
SchedulerOption = Annotated[
    str,
    typer.Option(
        metavar="tcp://HOST:PORT",
        help="Scheduler of a running dask cluster, instead of local processes. Its network must be trusted; "
        "tls:// with certificates otherwise.",
    ),
]
PatienceOption = Annotated[
    float, typer.Option(metavar="S", min=0.0, help="How long to wait for a lost scheduler [s].")
]
RetryOption = Annotated[bool, typer.Option("--retry", help="Also do again what failed in an earlier run.")]


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
    diagnose: bool = typer.Option(
        True, "--diagnose/--no-diagnose", help="Look for missing effects, add them, and refit."
    ),
    limit: float = typer.Option(
        0.0, metavar="S", min=0.0, help="Time after which a diagnosis ends with what it has found; 0: none."
    ),
    workers: WorkersOption = 2,
    scheduler: SchedulerOption = "",
    patience: PatienceOption = 60.0,
    retry: RetryOption = False,
) -> int:
    """Identify and diagnose many measurement sets; go on where an earlier run ended."""
    from flexviz.batch import ClusterChoice, SetOptions, run_batch
    from flexviz.observers import make_observer

    if options.group:
        raise InputError("--group: sets of a batch are fitted as they say themselves")
    bandwidth = parse_bandwidth(options.bandwidth)
    make_observer(options.observer, bandwidth)
    what = SetOptions(
        effects=tuple(options.effect or ()),
        observer=options.observer,
        bandwidth=tuple(bandwidth) if isinstance(bandwidth, list) else bandwidth,
        refine=options.refine,
        diagnosed=diagnose,
        limit=limit,
    )
    where = ClusterChoice(workers, scheduler, patience)
    with Reporter(f"reading {source}") as report, interruptible("finished sets are kept") as should_stop:
        done = run_batch(
            source, out, what, where,
            retry=retry, progress=report, should_stop=should_stop, note=terminal.note,
        )  # fmt: skip
    terminal.print_lines(lines(done))
    if not done.complete:
        return 130
    return 1 if any(row.state == "failed" for row in done.rows) else 0


def lines(done: BatchOutcome) -> list[str]:
    """Counts of states and verdicts, and where the results are."""
    from flexviz.batch import verdict_words

    counts = Counter(verdict_words(row) for row in done.rows)
    said = ", ".join(f"{count} {words}" for words, count in counts.most_common())
    count = done.count
    out = [f"{len(done.rows)} sets: {said}", f"computed now: {count.done}; kept from before: {count.kept}"]
    out += [f"failed: {row.set}: {row.error}" for row in done.rows if row.state == "failed"][:10]
    return [*out, f"{done.folder}: results.parquet, summary.html"]
