"""Errors of recorded robots, measured on every version's last model by one and the same code."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.diagnose_command import Json
from benchmarks.diagnosis_study.running import final_model
from benchmarks.kept_results import write
from benchmarks.measuring_stick.running import read_result, result_file
from benchmarks.measuring_stick.sets import StickSet
from benchmarks.real import held_out_share
from flexviz.measurements import read_set

HEAD = """| set | command | mean [% of torque spread] | each joint | stated | effects | last | CPU [s] |
|---|---|---|---|---|---|---|---|"""


def recorded_rows(work: Path, sets: Sequence[StickSet], names: Sequence[str]) -> list[str]:
    """Lines of a Markdown table, one for each set and command."""
    rows = []
    for one in sets:
        for name in names:
            result = read_result(work, name, one.key)
            if result is not None and "diagnosis" in result:
                rows.append(_row(one.key, name, result, _share(work, name, one, result)))
            elif result is not None:
                rows.append(f"| {one.key} | {name} | {result['error'].splitlines()[-1]} | | | | | |")
    return rows


def stated_share(got: Json) -> list[float]:
    """Held-out error of the last step over the torque's spread, as a result states it, shape (n,)."""
    steps, spread = got.get("steps") or [], got.get("torque", {}).get("spread", [])
    if not steps or not steps[-1].get("rms_validation"):
        return []
    return [rms / max(s, 1e-12) for rms, s in zip(steps[-1]["rms_validation"], spread, strict=False)]


def _share(work: Path, name: str, one: StickSet, result: Json) -> list[float]:
    """Held-out rms while moving over the torque's spread, shape (n,); kept in the result."""
    if "share" not in result:
        measurements = read_set(one.folder)
        model = final_model(result["diagnosis"], measurements.joints)
        result["share"] = held_out_share(measurements, model).tolist()
        write(result_file(work, name, one.key), result)
    return result["share"]


def _row(key: str, name: str, result: Json, share: list[float]) -> str:
    got = result["diagnosis"]
    stated = stated_share(got)
    mean = f"{100 * np.mean(stated):.1f}" if stated else "–"
    each = " ".join(f"{100 * x:.1f}" for x in share)
    last = got["steps"][-1]["verdict"] if got.get("steps") else got["verdict"]
    effects = len(got["model"]["effects"])
    return (
        f"| {key} | {name} | {100 * np.mean(share):.1f} | {each} | {mean} "
        f"| {effects} | {last} | {result['cpu']:.0f} |"
    )
