"""A run over many tasks: what is kept is not done again, the rest is spread over workers."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from pydantic import ValidationError

from flexviz.base.errors import InputError
from flexviz.base.files import named_errors
from flexviz.base.progress import Progress, ProgressCallback, StopCallback, ignore, never
from flexviz.outlets.batch.cluster import ClusterChoice, spread
from flexviz.outlets.batch.tasks import BatchTask, ResultStore, TaskResult, failed
from flexviz.outlets.batch.working import perform


@dataclass(frozen=True)
class RunCount:
    """How many tasks a run had: done before, done now, failed (of either), left undone."""

    kept: int
    done: int
    failed: int
    left: int


def run_tasks(
    tasks: Sequence[BatchTask],
    store: ResultStore,
    where: ClusterChoice,
    *,
    retry: bool = False,
    progress: ProgressCallback = ignore,
    should_stop: StopCallback = never,
    note: Callable[[str], None] = lambda _: None,
) -> tuple[dict[str, TaskResult], RunCount]:
    """The results of the tasks by their keys, each kept as soon as it is there.

    Tasks with the same key are done once. Failures that may not last are tried again in the next run, all
    failures with `retry`.
    """
    titles = {task.key: task.title for task in tasks}
    results: dict[str, TaskResult] = {}
    for key in titles:
        found = store.get(key)
        if found is not None and not (found.error and (retry or not found.lasting)):
            results[key] = found
    kept = len(results)
    texts = {task.key: task.text() for task in tasks if task.key not in results}
    began: float | None = None  # when the first worker did
    progress(Progress(f"{len(texts)} of {len(titles)} to do", kept / max(len(titles), 1)))
    for answer in spread(perform, texts.items(), where, should_stop, note):
        result = _result(answer.name, answer.text, answer.failure)
        results[result.key] = result
        store.put(result)
        began = time.monotonic() - result.seconds if began is None else began
        done, left = len(results) - kept, len(titles) - len(results)
        rest = (time.monotonic() - began) / done * left
        ended = f"failed: {result.error}" if result.error else f"{result.seconds:.1f} s"
        text = f"{len(results)} of {len(titles)}, {titles[result.key]}: {ended}"
        progress(Progress(text, len(results) / len(titles), rest=(rest, rest)))
    wrong = sum(bool(result.error) for result in results.values())
    return results, RunCount(kept, len(results) - kept, wrong, len(titles) - len(results))


def _result(key: str, text: str, failure: str) -> TaskResult:
    """The result in a worker's answer, which is not trusted to be one."""
    if failure:
        return failed(key, failure)
    try:
        found = TaskResult.model_validate_json(text)
    except ValidationError as error:
        return failed(key, f"the worker's answer is not a result ({error.error_count()} errors)")
    return found if found.key == key else failed(key, "the worker's answer belongs to another task")


def result_folder(folder: Path, marker: str, names: Sequence[str]) -> ResultStore:
    """The store in a folder, which is new, empty, or that of an earlier run (with the file `marker`)."""
    if folder.exists() and not folder.is_dir():
        raise InputError("this is a file, expected a folder for the results", file=folder)
    if folder.is_dir() and any(folder.iterdir()) and not (folder / marker).is_file():
        message = f"is not empty and has no {marker}, expected a new folder or the results of an earlier run"
        raise InputError(message, file=folder)
    with named_errors(folder, "made"):
        folder.mkdir(parents=True, exist_ok=True)
    store = ResultStore(folder)
    store.clean()
    for name in names:  # refuse before the work, not after it
        if (folder / name).is_dir():
            raise InputError("is a folder, expected a file", file=folder / name)
    return store
