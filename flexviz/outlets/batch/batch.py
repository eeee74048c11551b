"""`flexviz batch`: many measurement sets, one table and one page."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from flexviz import __version__
from flexviz.base.errors import InputError
from flexviz.base.files import as_json, write_file
from flexviz.base.progress import Progress, ProgressCallback, StopCallback, ignore, never
from flexviz.content.results import ResultDocument
from flexviz.outlets.batch.analysis import SetOptions, set_task
from flexviz.outlets.batch.cluster import ClusterChoice
from flexviz.outlets.batch.page import summary_page
from flexviz.outlets.batch.rows import FleetRow, fleet_row
from flexviz.outlets.batch.running import RunCount, result_folder, run_tasks
from flexviz.outlets.batch.sources import BatchSet, find_sets
from flexviz.outlets.batch.table import TABLE, read_table, write_table
from flexviz.outlets.batch.tasks import ResultStore, TaskResult, code_sha256

MARKER = "batch.json"
PAGE = "summary.html"


@dataclass(frozen=True, eq=False)
class BatchOutcome:
    """What a batch has written.

    Attributes:
        folder: with `results.parquet`, `summary.html`, `batch.json` and the results documents.
        rows: one per set.
        count: of tasks; sets with equal content are one task.
    """

    folder: Path
    rows: tuple[FleetRow, ...]
    count: RunCount

    @property
    def complete(self) -> bool:
        """Whether no set is left undone."""
        return not self.count.left


def run_batch(
    source: str | Path,
    out: str | Path,
    options: SetOptions = SetOptions(),  # noqa: B008  # frozen
    where: ClusterChoice = ClusterChoice(),  # noqa: B008
    *,
    retry: bool = False,
    progress: ProgressCallback = ignore,
    should_stop: StopCallback = never,
    note: Callable[[str], None] = lambda _: None,
) -> BatchOutcome:
    """Identify and diagnose every set of a folder or a list; go on where an earlier run ended.

    Args:
        source: folder that is searched for sets, or a list of them (`find_sets`).
        out: folder for the results: new, or that of an earlier run.
        options: what is done with each set.
        where: local processes or a cluster.
        retry: do failed sets again.
        progress, should_stop: see `flexviz.base.progress`; what was done before a stop is kept.
        note: called with remarks on the cluster.

    Raises:
        InputError: for a source without sets, or an unusable folder.
    """
    source, out = Path(source), Path(out)
    progress(Progress(f"looking for sets in {source}"))
    sets = find_sets(source)
    store = result_folder(out, MARKER, (TABLE, PAGE, MARKER))
    about = {
        "format": 1,
        "flexviz": __version__,
        "code": code_sha256(),
        "source": str(source.absolute()),
        "options": asdict(options),
    }
    write_file(out / MARKER, as_json(about))
    tasks = {one: set_task(one, options) for one in sets if not one.error}
    try:
        results, count = run_tasks(
            list(tasks.values()), store, where,
            retry=retry, progress=progress, should_stop=should_stop, note=note,
        )  # fmt: skip
    except BaseException:  # the table shows what is kept, however the run ended
        kept = {task.key: found for task in tasks.values() if (found := store.get(task.key)) is not None}
        _publish(sets, {one: task.key for one, task in tasks.items()}, kept, source, out)
        raise
    rows = _publish(sets, {one: task.key for one, task in tasks.items()}, results, source, out)
    return BatchOutcome(out, rows, count)


def _publish(
    sets: list[BatchSet], keys: dict[BatchSet, str], results: dict[str, TaskResult], source: Path, out: Path
) -> tuple[FleetRow, ...]:
    """Write table and page."""
    rows = tuple(fleet_row(one, keys.get(one, ""), results.get(keys.get(one, ""))) for one in sets)
    write_table(rows, out / TABLE)
    title = source.resolve().stem
    write_file(out / PAGE, summary_page(rows, title, dt.datetime.now().astimezone()))
    return rows


def is_batch(folder: Path) -> bool:
    """Whether this is the folder of a batch's results."""
    return (folder / MARKER).is_file() and (folder / TABLE).is_file()


def read_batch(folder: str | Path) -> list[FleetRow]:
    """The rows in the folder of a batch's results; InputError for any other folder."""
    folder = Path(folder)
    if not is_batch(folder):
        raise InputError(f"has no {MARKER} and {TABLE}, expected results of `flexviz batch`", file=folder)
    return read_table(folder / TABLE)


def set_results(folder: str | Path, row: FleetRow) -> dict[str, ResultDocument]:
    """The results documents of a set, "identification" and, if it was diagnosed, "diagnosis".

    Raises:
        InputError: it has none.
    """
    found = ResultStore(Path(folder)).get(row.key)
    if found is None or found.result is None:
        raise InputError(f"no results are kept for {row.set}", file=folder)
    names = ("identification", "diagnosis")
    return {name: ResultDocument.from_dict(found.result[name]) for name in names if found.result.get(name)}
