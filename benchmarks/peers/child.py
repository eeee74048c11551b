"""Runs one method in a process of its own: `python -m benchmarks.peers.child METHOD PROBLEM ANSWER`."""

from __future__ import annotations

import importlib
import json
import sys
import time
import traceback
from pathlib import Path
from typing import Any

from benchmarks.peers.problem import read


def peak_megabytes() -> float:
    """Largest memory of this process; unlike ru_maxrss without what the parent had when it forked."""
    for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) / 1024
    return float("nan")


def main(method: str, problem: str, out: str) -> None:
    found: dict[str, Any]
    try:
        module, given = importlib.import_module(f"benchmarks.peers.methods.{method}"), read(Path(problem))
        began = time.process_time()
        found = module.estimate(given)
        found["computing"] = time.process_time() - began
    except ImportError as error:
        found = {"missing": error.name}
    except Exception as error:
        traceback.print_exc()
        name = "" if isinstance(error, FloatingPointError) else f"{type(error).__name__}: "
        found = {"error": f"{name}{error}"}
    found["megabytes"] = peak_megabytes()
    Path(out).write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
