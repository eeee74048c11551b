"""flexviz beside its peers on the same sets: `python -m benchmarks.peers [--data DIR] [--write]`.

Each method runs on each set in a process of its own, one at a time, with one thread and a limit on its
processor time. DIR holds the recorded and the practice sets, `real/` and `practice/`; what is absent is
skipped. The paper's group B is simulated here. `--write` renews benchmarks/results/peers.md.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

from benchmarks.command import command
from benchmarks.peers import document, prepare, tables
from benchmarks.peers.judging import errors, held_out
from benchmarks.peers.running import METHODS, NOTHING, THIS, Method, run
from benchmarks.peers.sets import CASES, Case, folder_of, truth_of
from flexviz.data.measurements import read_set

LIMIT = 240.0  # [s] of processor time for one method on one set


def compare(
    case: Case, methods: Mapping[Method, str], data: Path | None, work: Path, limit: float, resume: bool
) -> list[tables.Row]:
    """All methods on one set, each by its interpreter; nothing if the set is absent."""
    folder = folder_of(case, data, work)
    if folder is None:
        print(f"{case.name}: skipped, no such set; --data names the folder with practice/ and real/")
        return []
    measurements = read_set(folder)
    truth = truth_of(case, data)
    problem = work / f"problem-{case.name}"
    if any(methods.values()):
        prepare.write(measurements, case.told, problem)
    rows = []
    for method, python in methods.items():
        if method.name == "flexviz_diagnose" and not case.hidden:
            continue
        outcome = run(method, problem, python, limit, resume)
        row = tables.Row(method, outcome)
        if outcome.answer is not None:
            judged = tuple(errors(measurements.robot, truth, outcome.answer)) if truth else ()
            share = float(held_out(measurements, outcome.answer).mean())
            row = tables.Row(method, outcome, judged, share)
        rows.append(row)
        print(f"{case.name}: {method.label}, {outcome.failure or 'done'}", file=sys.stderr, flush=True)
    return rows


def chosen(text: str | None, names: Sequence[str], what: str) -> list[str]:
    """The names in a comma-separated option; all without it."""
    if text is None:
        return list(names)
    given = [name for name in text.split(",") if name]
    for name in given:
        if name not in names:
            raise SystemExit(f"{what} {name!r} does not exist; choose among {', '.join(names)}")
    return given


@command
def main(
    *,
    data: Annotated[Path | None, "folder with practice/ and real/"] = None,
    work: Annotated[Path | None, "keep problems, answers and logs here"] = None,
    only: Annotated[str | None, ", ".join(m.name for m in METHODS)] = None,
    sets: Annotated[str | None, ", ".join(c.name for c in CASES)] = None,
    figaroh: Annotated[str, "interpreter that has FIGAROH"] = THIS,
    mujoco: Annotated[str, "interpreter that has mujoco[sysid]"] = THIS,
    limit: Annotated[float, "CPU seconds per run"] = LIMIT,
    resume: Annotated[bool, "keep what --work has of an earlier run"] = False,
    kept: Annotated[bool, "run nothing: only what --work has"] = False,
    write: Annotated[bool, "renew benchmarks/results/peers.md"] = False,
) -> None:
    names = chosen(only, [m.name for m in METHODS], "method")
    wanted = chosen(sets, [c.name for c in CASES], "set")
    pythons = {"mujoco_sysid": mujoco, "figaroh": figaroh}
    methods = {m: NOTHING if kept else pythons.get(m.name, THIS) for m in METHODS if m.name in names}
    results = []
    with TemporaryDirectory() as temporary:
        place = (work or Path(temporary)).resolve()
        place.mkdir(parents=True, exist_ok=True)
        for case in (c for c in CASES if c.name in wanted):
            rows = compare(case, methods, data, place, limit, resume or kept)
            if rows:
                results.append((case, rows))
                print(f"\n{document.section(case, rows)}\n", flush=True)
    if write:
        document.write(results, limit, {"mujoco": mujoco, "figaroh": figaroh})


if __name__ == "__main__":
    sys.exit(main())
