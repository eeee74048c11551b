"""Whether two versions of flexviz give the same results on the same sets.

    python -m benchmarks.same_results run DIR SET [SET …]     with each version, into a folder of its own
    python -m benchmarks.same_results compare DIR OTHER

`run` writes the results of `identify`, `identify --refine` and `diagnose --apply` for each set and keeps
those that exist. `compare` prints the largest relative difference of the numbers in DIR, except seconds,
and any other value that differs. The exit code is 1 above 1e-9.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

COMMANDS = {"plain": ("identify",), "refine": ("identify", "--refine"), "diagnose": ("diagnose", "--apply")}
LARGEST = 1e-9  # relative difference that rounding explains
TEXTS = ("notes", "message")  # keys whose words may change


def run(out: Path, sets: list[Path], jobs: int) -> None:
    """Run the commands of the flexviz beside this file on all sets, `jobs` at a time."""
    out.mkdir(parents=True, exist_ok=True)
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(Path(__file__).parents[1])}

    def one(folder: Path) -> None:
        for name, (command, *options) in COMMANDS.items():
            file = out / f"{folder.name}.{name}.json"
            if not file.is_file():
                words = [sys.executable, "-m", "flexviz", command, str(folder), *options, "--json", str(file)]
                subprocess.run(words, env=environment, capture_output=True, check=False)
        print(folder.name, flush=True)

    with ThreadPoolExecutor(jobs) as pool:
        list(pool.map(one, sets))


def differences(old: Any, new: Any, place: str = "") -> Iterator[tuple[float, str]]:
    """(relative difference, where) of all that `old` holds; infinite for another kind or a missing entry."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in old.keys() - {"seconds"}:
            yield from differences(old[key], new.get(key), f"{place}/{key}")
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for number, (a, b) in enumerate(zip(old, new, strict=True)):
            yield from differences(a, b, f"{place}[{number}]")
    elif isinstance(old, int | float) and isinstance(new, int | float):
        yield abs(old - new) / max(abs(old), abs(new), 1e-12), f"{place}: {old} → {new}"
    elif old != new:
        words = any(key in place for key in TEXTS)
        yield (0.0 if words else float("inf")), f"{place}: {old!r} → {new!r}"


def compare(before: Path, after: Path) -> bool:
    """Print the differences; whether there is none above `LARGEST`."""
    compared, wrong, rest = 0, 0, 0.0
    for file in sorted(before.glob("*.json")):
        if not (after / file.name).is_file():
            print(f"{file.name}: not in {after}")
            continue
        compared += 1
        old, new = (
            json.loads((folder / file.name).read_text(encoding="utf-8")) for folder in (before, after)
        )
        worst = max(differences(old, new), default=(0.0, ""))
        if worst[0] > LARGEST:
            wrong += 1
            print(f"{file.name}: {worst[0]:.1e} at {worst[1]}")
        else:
            rest = max(rest, worst[0])
    print(f"{compared} results, {wrong} differ by more than {LARGEST:g}; the others by {rest:.1e} at most")
    return not wrong


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.same_results",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("command", choices=("run", "compare"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("others", type=Path, nargs="+", metavar="SET or OTHER")
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    if options.command == "run":
        run(options.folder.absolute(), [path.absolute() for path in options.others], options.jobs)
        return 0
    return 0 if compare(options.folder, options.others[0]) else 1


if __name__ == "__main__":
    sys.exit(main())
