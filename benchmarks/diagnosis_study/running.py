"""Diagnose cases in worker processes, one file a result: what is there is not done again."""

from __future__ import annotations

import json
import os
import signal
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.diagnosis_study.answers import DECIDABLE
from benchmarks.diagnosis_study.cases import Case, cases
from benchmarks.diagnosis_study.making import case_folder, is_made, make, make_twin, truth_file
from benchmarks.kept_results import say, write

Json = dict[str, Any]

LONGEST = 600.0  # [s] after that a diagnosis is stopped


def known_file(work: Path, name: str) -> Path:
    """What a fit that knows the truth gains."""
    return work / "known" / f"{name}.json"


def result_file(work: Path, name: str, label: str) -> Path:
    """What a diagnosis said; `label` tells several versions of it apart."""
    return work / label / f"{name}.json"


def make_all(work: Path, cases: list[Case], jobs: int) -> None:
    """Simulate what is not there yet."""
    missing = [case for case in cases if not is_made(work, case)]
    given = [(work, case) for case in missing]
    for done, (case, failed) in enumerate(spread(make, given, missing, jobs), 1):
        say(f"{done}/{len(missing)} {case.name}{f': {failed}' if failed else ''}")


def run_all(work: Path, names: list[str], jobs: int, label: str, scheduler: str = "") -> None:
    """Diagnose, and fit with the truth known, what has no result yet.

    With a scheduler (tcp://HOST:PORT) on the workers of its dask cluster, which see `work` and this project.
    """
    missing = [
        n for n in names if not (known_file(work, n).is_file() and result_file(work, n, label).is_file())
    ]
    lines = spread(run_one, [(work, n, label) for n in missing], missing, jobs)
    if scheduler:
        lines = on_cluster(work, missing, label, scheduler)
    for done, (name, line) in enumerate(lines, 1):
        say(f"{done}/{len(missing)} {name}: {line}")


def on_cluster(work: Path, names: list[str], label: str, scheduler: str) -> Iterator[tuple[str, str]]:
    """`run_one` for each on a dask cluster: (name, line) as they are done."""
    from flexviz.batch import ClusterChoice
    from flexviz.batch import spread as spread_texts

    texts = ((name, json.dumps([str(work.resolve()), name, label])) for name in names)
    for answer in spread_texts(run_text, texts, ClusterChoice(scheduler=scheduler), note=say):
        yield answer.name, answer.text or f"failed, {answer.failure}"


def run_text(text: str) -> str:
    """`run_one` of its arguments as JSON; a failure is a line."""
    work, name, label = json.loads(text)
    try:
        return run_one(Path(work), name, label)
    except Exception as error:
        return f"failed, {error!r}"


def run_one(work: Path, name: str, label: str) -> str:
    """One case; what it says in a line."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):
        result, known = result_file(work, name, label), known_file(work, name)
        if not result.is_file():
            write(result, _diagnosed(work, name))
        if not known.is_file():
            write(known, _known(work, name))
    got = json.loads(result.read_text(encoding="utf-8"))
    gain = json.loads(known.read_text(encoding="utf-8"))["gain"]
    if "error" in got:
        return f"gain {gain:.3g}, {got['error']}"
    added = [s["added"]["effect"] for s in got["diagnosis"]["steps"] if s["added"]]
    return f"gain {gain:.3g}, {got['diagnosis']['verdict']} {' '.join(added)}, {got['wall']:.1f} s"


def _diagnosed(work: Path, name: str) -> Json:
    """The diagnosis of a case. Nothing but the measurement set is known here."""
    from benchmarks.diagnosis_study.oracle import errors
    from flexviz.diagnosis import diagnose
    from flexviz.measurements import read_set

    began, began_cpu = time.perf_counter(), time.process_time()
    try:
        measurements = read_set(case_folder(work, name))
        end = began + LONGEST
        diagnosis = diagnose(measurements, apply=True, should_stop=lambda: time.perf_counter() > end)
    except Exception as error:  # a case that fails is a result, too
        return {"error": f"{type(error).__name__}: {error}", "trace": traceback.format_exc()} | _spent(
            began, began_cpu
        )
    spent = _spent(began, began_cpu)
    document = diagnosis.to_dict()
    return {
        "diagnosis": document,
        "features": [s.added.features for s in diagnosis.steps if s.added is not None],
        "errors": errors(measurements, final_model(document, measurements.joints)),
        **spent,
    }


def _spent(began: float, began_cpu: float) -> Json:
    return {"wall": time.perf_counter() - began, "cpu": time.process_time() - began_cpu}


def _known(work: Path, name: str) -> Json:
    """The fit that knows the truth; the truth file learns whether its case can be decided."""
    from benchmarks.diagnosis_study.oracle import errors, know
    from flexviz.measurements import read_set

    path = truth_file(work, name)
    truth = json.loads(path.read_text(encoding="utf-8"))
    measurements = read_set(case_folder(work, name))
    began = time.perf_counter()
    known = know(measurements, truth, _twin(name, truth))
    ratio = np.sqrt(np.array(known.chi_base) / np.array(known.chi))
    if truth["effects"]:
        truth["weak"] = min(known.gains, default=known.gain) < DECIDABLE
        truth["residual_ratio"] = float(ratio.max())
        write(path, truth)
    model = known.model
    return {
        "gain": known.gain,
        "gains": known.gains,
        "objective_gain": known.objective_gain,
        "chi": known.chi,
        "chi_base": known.chi_base,
        "chi_held_out": known.chi_held_out,
        "converged": known.converged,
        "errors": errors(measurements, model) if known.gains or not truth["effects"] else None,
        "stiffness": model.stiffness.tolist(),
        "motor_inertia": model.motor_inertia.tolist(),
        "effects": [asdict(e) for e in model.effects],
        "seconds": time.perf_counter() - began,
    }


def _twin(name: str, truth: Json) -> Any:
    """The case without its law, where that is one that the library does not have; else None."""
    from flexviz.measurements import read_set

    if truth["kind"] != "unknown":
        return None
    case = next(c for c in cases(truth["seed"]) if c.name == name)
    with tempfile.TemporaryDirectory() as folder:
        make_twin(case, Path(folder) / name)
        return read_set(Path(folder) / name)


def final_model(document: Json, joints: tuple[str, ...]) -> Any:
    """The final model of a diagnosis, from its JSON."""
    from flexviz.equation.layout import INERTIAL_NAMES
    from flexviz.model import EffectValue, FlexibleModel

    values = {(p["name"], p["joint"]): p["value"] for p in document["model"]["parameters"]}

    def column(name: str) -> list[float]:
        return [values[name, joint] for joint in joints]

    effects = [
        EffectValue(
            e["effect"], e["joint"], {k: v["value"] for k, v in e["parameters"].items()},
            e.get("group"), e.get("payload"),
        )
        for e in document["model"]["effects"]
    ]  # fmt: skip
    return FlexibleModel(
        joints,
        np.array(column("stiffness")),
        np.array(column("motor_inertia")),
        np.array(column("link_viscous_friction")),
        np.array(column("motor_viscous_friction")),
        np.array([column(name) for name in INERTIAL_NAMES]).T,
        tuple(effects),
    )


def spread(
    work: Callable[..., Any], arguments: list[tuple[Any, ...]], labels: list[Any], jobs: int
) -> Iterator[tuple[Any, Any]]:
    """Call `work` on each in worker processes; (label, what it gave or why it failed) as they are done."""
    remaining = list(zip(labels, arguments, strict=True))
    while remaining:
        lost: list[tuple[Any, tuple[Any, ...]]] = []
        with _pool(jobs) as pool:
            waiting = {pool.submit(work, *given): (label, given) for label, given in remaining}
            for future in as_completed(waiting):
                error = future.exception()
                if isinstance(error, BrokenProcessPool):  # a worker was killed, and took the others with it
                    lost.append(waiting[future])
                else:
                    yield waiting[future][0], future.result() if error is None else f"failed, {error!r}"
        if len(lost) == len(remaining):
            for label, _ in lost:
                yield label, "failed, a worker was killed"
            return
        remaining = lost


@contextmanager
def _pool(jobs: int) -> Iterator[ProcessPoolExecutor]:
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # spawned, so that they see one thread a process; Ctrl+C ends what waits, not what is being done
    ignore = (signal.SIGINT, signal.SIG_IGN)
    pool = ProcessPoolExecutor(
        jobs, mp_context=get_context("spawn"), initializer=signal.signal, initargs=ignore
    )
    try:
        yield pool
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
