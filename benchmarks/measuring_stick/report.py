"""The report in Markdown: what every study reports, and the errors of recorded robots.

Those are measured on every version's last model by one and the same code.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.diagnosis_study.judging import judge
from benchmarks.diagnosis_study.oracle import final_model
from benchmarks.diagnosis_study.report import report as study_report
from benchmarks.diagnosis_study.report import text
from benchmarks.measuring_stick.sets import CLASSES, MANY, StickSet
from benchmarks.real import held_out_share
from benchmarks.running import Json, read, result_file, write
from benchmarks.tables import NONE, Table
from flexviz.data.measurements import read_set


def report(work: Path, sets: Sequence[StickSet], names: Sequence[str]) -> str:
    """The whole report of the commands with these names."""
    files = {name: {one.key: result_file(work / "results" / name, one.key) for one in sets} for name in names}
    judged = {
        name: {
            one.key: judge(read(one.truth) if one.truth else None, read(file), CLASSES[one.kind] == MANY)
            for one in sets
            if (file := files[name][one.key]).is_file()
        }
        for name in names
    }
    parts = study_report(judged, {one.key: one.kind for one in sets})
    recorded = [row for one in sets if one.kind == "real" for name in names for row in _row(one, name, files)]
    if recorded:
        head = [
            "set",
            "command",
            "mean [% of torque spread]",
            "each joint",
            "stated",
            "effects",
            "last",
            "CPU [s]",
        ]
        parts[2:2] = ["Recorded robots: held-out rms while moving, last model", [head, *recorded]]
    return text(parts, in_markdown=True)


def stated_share(got: Json) -> list[float]:
    """Held-out error of the last step over the torque's spread, as a result states it, shape (n,)."""
    steps, spread = got.get("steps") or [], got.get("torque", {}).get("spread", [])
    if not steps or not steps[-1].get("rms_validation"):
        return []
    return [rms / max(s, 1e-12) for rms, s in zip(steps[-1]["rms_validation"], spread, strict=False)]


def _row(one: StickSet, name: str, files: dict[str, dict[str, Path]]) -> Table:
    """The row of a set and a command, none without a result; the errors are kept in the result."""
    file = files[name][one.key]
    if not file.is_file():
        return []
    result = read(file)
    if "diagnosis" not in result:
        return [[one.key, name, result["error"].splitlines()[-1], *[""] * 5]]
    got = result["diagnosis"]
    if "share" not in result:
        measurements = read_set(one.folder)
        result["share"] = held_out_share(measurements, final_model(got, measurements.joints)).tolist()
        write(file, result)
    stated, share = stated_share(got), result["share"]
    return [[
        one.key, name, f"{100 * np.mean(share):.1f}", " ".join(f"{100 * x:.1f}" for x in share),
        f"{100 * np.mean(stated):.1f}" if stated else NONE, str(len(got["model"]["effects"])),
        got["steps"][-1]["verdict"] if got.get("steps") else got["verdict"], f"{result['cpu']:.0f}",
    ]]  # fmt: skip
