"""Studies: many runs of one kind, a table with a row per run and parameter, and a summary page."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa

from flexviz import __version__
from flexviz.base.files import as_json, write_file
from flexviz.base.progress import ProgressCallback, StopCallback, ignore, never
from flexviz.outlets.batch.cluster import ClusterChoice
from flexviz.outlets.batch.running import RunCount, result_folder, run_tasks
from flexviz.outlets.batch.study_page import study_page
from flexviz.outlets.batch.study_plan import StudyPlan, StudyRun, is_right, run_of, study_tasks
from flexviz.outlets.batch.table import write_parquet
from flexviz.outlets.batch.tasks import code_sha256

MARKER, TABLE = "study.json", "runs.parquet"
COLUMNS = {
    "run": pa.int64(), "setting": pa.float64(), "seed": pa.int64(), "key": pa.string(), "error": pa.string(),
    "verdict": pa.string(), "found": pa.list_(pa.string()), "right": pa.bool_(), "residual": pa.float64(),
    "parameter": pa.string(), "value": pa.float64(), "std": pa.float64(), "unit": pa.string(),
    "identifiable": pa.string(), "truth": pa.float64(),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class StudyOutcome:
    """What a study has written to `folder`: `runs.parquet`, `summary.html`, `study.json`, results."""

    folder: Path
    plan: StudyPlan
    runs: tuple[StudyRun, ...]
    count: RunCount

    @property
    def complete(self) -> bool:
        """Whether no run is left undone."""
        return not self.count.left


def run_study(
    plan: StudyPlan,
    out: str | Path,
    where: ClusterChoice = ClusterChoice(),  # noqa: B008  # frozen
    *,
    retry: bool = False,
    progress: ProgressCallback = ignore,
    should_stop: StopCallback = never,
    note: Callable[[str], None] = lambda _: None,
) -> StudyOutcome:
    """Do the runs of a study that are not kept in `out` yet, and summarise all; see `run_batch`.

    Raises:
        InputError: for a source that is no set or preset, or an unusable folder.
    """
    out = Path(out)
    tasks = list(study_tasks(plan))
    store = result_folder(out, MARKER, (MARKER, TABLE, "summary.html"))
    about = {"format": 1, "flexviz": __version__, "code": code_sha256(), "plan": asdict(plan)}
    write_file(out / MARKER, as_json(about))
    options: dict[str, Any] = {"retry": retry, "progress": progress, "should_stop": should_stop, "note": note}
    results, count = run_tasks(tasks, store, where, **options)
    runs = tuple(run_of(i, task, results.get(task.key)) for i, task in enumerate(tasks, 1))
    write_parquet(runs_table(plan, runs), out / TABLE)
    page = study_page(plan, runs, dt.datetime.now().astimezone())
    write_file(out / "summary.html", page)
    return StudyOutcome(out, plan, runs, count)


def runs_table(plan: StudyPlan, runs: Sequence[StudyRun]) -> pa.Table:
    """A table with a row per run and parameter; a failed run is one row with its error."""
    rows = []
    for run in runs:
        result = run.result or {}
        about = {
            "run": run.number, "setting": run.setting, "seed": run.seed, "key": run.key, "error": run.error,
            "verdict": result.get("verdict"), "found": list(run.found), "right": is_right(plan, run),
            "residual": result.get("residual"),
        }  # fmt: skip
        for name, (value, std, unit, grade) in (run.parameters or {"": (None, None, None, None)}).items():
            values = {"parameter": name or None, "value": value, "std": std, "unit": unit}
            rows.append({**about, **values, "identifiable": grade, "truth": run.truth.get(name)})
    return pa.Table.from_pylist(rows, schema=pa.schema(list(COLUMNS.items())))
