"""Diagnose cases and fit them with the truth known, one file a result: what is there is not done again."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.diagnosis_study.cases import cases
from benchmarks.diagnosis_study.making import make_twin
from benchmarks.diagnosis_study.tables import DECIDABLE
from benchmarks.running import (
    DiagnoseCommand,
    Json,
    as_done,
    case_folder,
    read,
    result_file,
    say,
    truth_file,
    workers,
    write,
)

LONGEST = 600.0  # [s] after that a diagnosis is stopped


def known_file(work: Path, name: str) -> Path:
    """What a fit that is given the hidden effects gains."""
    return work / "known" / f"{name}.json"


def run_all(work: Path, names: list[str], jobs: int, label: str, scheduler: str = "") -> None:
    """Diagnose, and fit with the truth known, what has no result yet.

    With a scheduler (tcp://HOST:PORT) on the workers of its dask cluster, which see `work` and this project.
    """
    missing = [
        n for n in names if not (known_file(work, n).is_file() and result_file(work / label, n).is_file())
    ]
    if not scheduler:
        for _ in as_done(workers(jobs), run_one, {n: (work, n, label) for n in missing}):
            pass
        return
    from flexviz.outlets.batch import ClusterChoice, spread

    texts = ((name, json.dumps([str(work.resolve()), name, label])) for name in missing)
    answers = spread(run_text, texts, ClusterChoice(scheduler=scheduler), note=say)
    for count, answer in enumerate(answers, 1):
        say(f"{count}/{len(missing)} {answer.name}: {answer.text or f'failed, {answer.failure}'}")


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

    from benchmarks.diagnosis_study.oracle import errors, final_model
    from flexviz.data.measurements import read_set

    out, known = result_file(work / label, name), known_file(work, name)
    with threadpool_limits(1):
        if not out.is_file():
            got = DiagnoseCommand(timeout=LONGEST).answer(case_folder(work, name))
            if "diagnosis" in got:
                measurements = read_set(case_folder(work, name))
                got["errors"] = errors(measurements, final_model(got["diagnosis"], measurements.joints))
            write(out, got)
        if not known.is_file():
            write(known, _known(work, name))
    got, gain = read(out), f"gain {read(known)['gain']:.3g}"
    if "error" in got:
        return f"{gain}, {got['error']}"
    added = [s["added"]["effect"] for s in got["diagnosis"]["steps"] if s["added"]]
    return f"{gain}, {got['diagnosis']['verdict']} {' '.join(added)}, {got['wall']:.1f} s"


def _known(work: Path, name: str) -> Json:
    """The fit that knows the truth; the truth file learns whether its case can be decided."""
    from benchmarks.diagnosis_study.oracle import know
    from flexviz.data.measurements import read_set

    path = truth_file(work, name)
    truth = read(path)
    known = know(read_set(case_folder(work, name)), truth, _twin(name, truth))
    if truth["effects"]:
        truth["weak"] = min(known["gains"], default=known["gain"]) < DECIDABLE
        ratio = np.sqrt(np.array(known["chi_base"]) / np.array(known["chi"]))
        write(path, truth | {"residual_ratio": float(ratio.max())})
    return known


def _twin(name: str, truth: Json) -> Any:
    """The case without its law, where that is one that the library does not have; else None."""
    from flexviz.data.measurements import read_set

    if truth["kind"] != "unknown":
        return None
    case = next(c for c in cases(truth["seed"]) if c.name == name)
    with tempfile.TemporaryDirectory() as folder:
        make_twin(case, Path(folder) / name)
        return read_set(Path(folder) / name)
