"""The work on one task, in whatever process: a text in, a text out."""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Callable

from flexviz.base.errors import FlexvizError, InputError
from flexviz.outlets.batch.analysis import analyse_set
from flexviz.outlets.batch.study_runs import resampled_run, simulated_run, sweep_run
from flexviz.outlets.batch.tasks import Json, TaskResult, code_sha256, failed

log = logging.getLogger("flexviz.outlets.batch")

KINDS: dict[str, Callable[[Json, Json], Json]] = {
    "set": analyse_set,
    "monte-carlo": simulated_run,
    "bootstrap": resampled_run,
    "bandwidth": sweep_run,
    "detection": simulated_run,
}


def perform(text: str) -> str:
    """Do a task (`BatchTask.text`) and return its `TaskResult` as JSON; errors are results, too."""
    from threadpoolctl import threadpool_limits

    task = json.loads(text)
    key, began = task["key"], time.perf_counter()
    with threadpool_limits(1):  # small matrices: the workers are the parallel part
        try:
            if task["code"] != code_sha256():
                raise FlexvizError("the worker has other files of flexviz than the program that was called")
            done = TaskResult(key=key, result=KINDS[task["kind"]](task["what"], task["where"]))
        except FlexvizError as error:
            done = failed(key, str(error), lasting=isinstance(error, InputError))
        except Exception as error:  # a fault of the program ends one task, not the run
            log.exception("task %s failed", key)
            done = failed(key, f"{type(error).__name__}: {error}")
    return done.model_copy(update={"seconds": time.perf_counter() - began}).model_dump_json()
