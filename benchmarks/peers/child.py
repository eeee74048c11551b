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
from benchmarks.running import peak_megabytes


def main(method: str, problem: str, out: str) -> None:
    found: dict[str, Any]
    try:
        own = method.startswith("flexviz")
        place = "flexviz_answer" if own else f"methods.{method}"
        module, given = importlib.import_module(f"benchmarks.peers.{place}"), read(Path(problem))
        began = time.process_time()
        found = getattr(module, method if own else "estimate")(given)
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
