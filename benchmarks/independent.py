"""The simulator of the tests that shares no code with flexviz, for benchmarks."""

import sys
from importlib import import_module
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
cases, files = import_module("independent.cases"), import_module("independent.files")
make_case = cases.make_case
