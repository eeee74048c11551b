"""flexviz beside its peers on the same sets: `python -m benchmarks.peers [--data DIR] [--write]`.

Each method runs on each set in a process of its own, one at a time, with one thread and a limit on its
processor time. DIR holds the recorded and the practice sets, `real/` and `practice/`; what is absent is
skipped. The paper's group B is simulated here. `--write` renews docs/peers.md.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.peers import document, prepare, tables
from benchmarks.peers.judging import errors, held_out
from benchmarks.peers.running import METHODS, NOTHING, THIS, Method, run
from benchmarks.peers.sets import CASES, Case, folder_of, truth_of
from flexviz.measurements import read_set

LIMIT = 240.0  # [s] of processor time for one method on one set


def compare(
    case: Case, methods: Sequence[Method], options: argparse.Namespace, work: Path
) -> list[tables.Row]:
    """All methods on one set; nothing if it is absent."""
    folder = folder_of(case, options.data, work)
    if folder is None:
        print(f"{case.name}: skipped, no such set; --data names the folder with practice/ and real/")
        return []
    measurements = read_set(folder)
    truth = truth_of(case, options.data)
    problem = work / f"problem-{case.name}"
    if not options.kept:
        prepare.write(measurements, case.told, problem)
    rows = []
    for method in methods:
        if method.name == "flexviz_diagnose" and not case.hidden:
            continue
        python = (
            NOTHING
            if options.kept
            else {"mujoco_sysid": options.mujoco, "figaroh": options.figaroh}.get(method.name, THIS)
        )
        outcome = run(method, problem, python, options.limit, options.resume or options.kept)
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


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.peers",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--data", type=Path, metavar="DIR", help="folder with practice/ and real/")
    parser.add_argument("--work", type=Path, metavar="DIR", help="keep problems, answers and logs here")
    parser.add_argument("--only", metavar="METHOD,..", help=", ".join(m.name for m in METHODS))
    parser.add_argument("--sets", metavar="SET,..", help=", ".join(c.name for c in CASES))
    parser.add_argument(
        "--figaroh", default=THIS, metavar="PYTHON", help="interpreter that has FIGAROH (default: this one)"
    )
    parser.add_argument(
        "--mujoco", default=THIS, metavar="PYTHON", help="interpreter that has mujoco[sysid] (default: this)"
    )
    parser.add_argument(
        "--limit", type=float, default=LIMIT, help="CPU seconds per run (default: %(default)s)"
    )
    parser.add_argument("--resume", action="store_true", help="keep what --work has of an earlier run")
    parser.add_argument("--kept", action="store_true", help="run nothing: only what --work has")
    parser.add_argument("--write", action="store_true", help="renew docs/peers.md")
    options = parser.parse_args()
    names = chosen(options.only, [m.name for m in METHODS], "method")
    sets = chosen(options.sets, [c.name for c in CASES], "set")
    methods = [m for m in METHODS if m.name in names]
    results = []
    with TemporaryDirectory() as temporary:
        work = (options.work or Path(temporary)).resolve()
        work.mkdir(parents=True, exist_ok=True)
        for case in (c for c in CASES if c.name in sets):
            rows = compare(case, methods, options, work)
            if rows:
                results.append((case, rows))
                print(f"\n{document.section(case, rows)}\n", flush=True)
    if options.write:
        document.write(results, options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
