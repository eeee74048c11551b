"""Do the tests notice a fault in the mathematics? Random small changes of the code, each against the tests.

    python -m benchmarks.mutants [equation observers effects] [--count 200] [--seed 1] [--out FILE]

A mutant is a package with one change: another comparison or operation, another constant, a negated condition
or result, a statement left out. The quick tests of the package (`TESTS`) run once to learn which of them run
which line; a mutant meets those that run its line, quickest first, until one fails. No file is changed: the
mutant is compiled in memory, in a process of its own. The file `--out` keeps what was caught; survivors are
tried again. `code_changes.py` says what is left alone.
"""

from __future__ import annotations

import ast
import importlib
import importlib.machinery
import json
import os
import random
import resource
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any

import coverage
import pytest

from benchmarks.code_changes import Changer
from benchmarks.command import command

ROOT = Path(__file__).parents[1]
MODEL = "flexviz/model"  # its packages are changed
TESTS = {
    "equation": (
        "equation_exact.py", "equation_parts.py", "equation_truth.py", "equation.py", "effects_limits.py",
        "effects_memory.py",
        "diagnosis_parts.py::test_pulses_and_steps_are_what_filtering_makes_of_them",
        "diagnosis_parts.py::test_fewer_samples_of_smooth_columns_suffice",
        "diagnosis_parts.py::test_residual_alone_is_the_residual",
        "long_records.py::test_wide_band_signals_of_long_records_are_kept_once",
        "long_records.py::test_the_pulses_of_a_long_stretch_take_memory_with_its_length",
        "temperature_friction.py::test_an_effect_needs_the_temperature_of_every_group",
    ),
    "observers": ("observers.py", "observer_gains.py", "equation.py"),
    "effects": (
        "effects_judged.py", "effects_curves.py", "effects.py", "effects_limits.py", "effects_coupled.py",
        "effects_elastic.py", "effects_memory.py", "curve_forms.py", "equation_truth.py", "equation_parts.py",
        "equation.py::test_choosing_effects", "equation.py::test_effects_as_text_and_back",
        "equation.py::test_effects_that_are_nowhere", "diagnosis_parts.py::test_what_is_judged",
        "temperature_friction.py::test_closed_form_at_several_temperatures",
        "free_curve_effect.py::test_law", "free_curve_effect.py::test_range_is_that_of_the_data",
        "free_curve_effect.py::test_never_a_candidate", "user_effect_terms.py",
        "user_effects.py::test_derivatives_and_simulation_are_checked",
        "user_effects.py::test_files_that_are_none", "user_effects.py::test_errors_name_file_and_line",
    ),
}  # fmt: skip
QUICK = "not identif and not recover and not wound_up and not torque_goes_on"  # those simulate first
BUDGET = 12.0  # [s] of processor time, in an unhurried process, for the tests of one mutant
PATIENCE = 10.0  # a mutant that needs so many times the processor time of its tests is stuck, and noticed
OURS = ("flexviz", "tests", "benchmarks")


@dataclass(frozen=True)
class Mutant:
    """One change of one file.

    Attributes:
        path: the file, relative to the project.
        number: which of the file's changes it is.
        lines: first and last line of the changed statement, or of its head.
        text: what was changed into what.
    """

    path: str
    number: int
    lines: tuple[int, int]
    text: str

    @property
    def module(self) -> str:
        return self.path.removesuffix(".py").replace("/", ".").removesuffix(".__init__")

    def key(self) -> str:
        """The same for the same change of the same text."""
        return f"{self.path}:{self.number}:{sha256((ROOT / self.path).read_bytes()).hexdigest()[:12]}"


def mutants(package: str, count: int, seed: int) -> list[Mutant]:
    """A random choice of the changes of a package."""
    found = []
    for path in sorted((ROOT / MODEL / package).glob("*.py")):
        changer = Changer()
        changer.visit(ast.parse(path.read_text()))
        name = path.relative_to(ROOT).as_posix()
        found += [Mutant(name, k, lines, text) for k, (lines, text) in enumerate(changer.found)]
    return random.Random(f"{package} {seed}").sample(found, min(count, len(found)))


class Mutation(importlib.machinery.PathFinder):
    """Gives the changed module instead of the one on the disk."""

    def __init__(self, mutant: Mutant) -> None:
        tree = Changer(mutant.number).visit(ast.parse((ROOT / mutant.path).read_text()))
        self.module, self.code = mutant.module, compile(tree, str(ROOT / mutant.path), "exec")

    def find_spec(self, fullname: str, path: Any = None, target: Any = None) -> Any:  # type: ignore[override]
        if fullname != self.module:
            return None
        spec = importlib.machinery.PathFinder.find_spec(fullname, path, target)
        assert spec and spec.loader
        spec.loader.get_code = lambda name: self.code  # type: ignore[attr-defined]
        return spec


def forked(work: Callable[[], int], processor_time: float) -> int | None:
    """The exit code of `work` in a process of its own; None where it had to be ended."""
    child = os.fork()
    if child == 0:
        code = 70
        try:
            os.setsid()
            hole = os.open(os.devnull, os.O_RDWR)
            for descriptor in (0, 1, 2):
                os.dup2(hole, descriptor)
            limit = int(processor_time) + 1
            resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
            code = work()
        finally:
            os._exit(code)
    end = time.monotonic() + 10 * processor_time
    while True:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status) if os.WIFEXITED(status) else None
        if time.monotonic() > end:
            os.killpg(child, signal.SIGKILL)
        time.sleep(0.01)


def run_tests(names: Sequence[str], *plugins: Any) -> int:
    """Pytest's exit code."""
    os.chdir(ROOT)
    with tempfile.TemporaryDirectory() as folder:
        options = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", f"--basetemp={folder}/made"]
        return int(pytest.main([*options, *names], plugins=list(plugins)))


class Recorder:
    """Which test runs which line, and how long each takes, as a plugin of pytest."""

    def __init__(self, package: str) -> None:
        source = [f"{ROOT}/{MODEL}/{package}/*"]
        self.coverage = coverage.Coverage(data_file=None, include=source, config_file=False)
        self.seconds: dict[str, float] = {}
        self.now = ""

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: Any) -> Iterator[Any]:
        self.now = item.nodeid
        self.coverage.switch_context(self.now)
        begun = time.process_time()
        done = yield
        self.seconds[item.nodeid] = time.process_time() - begun
        return done

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any, request: Any) -> Iterator[Any]:
        if fixturedef.scope != "function":  # what it runs, every test of the file may need
            self.coverage.switch_context(f"{fixturedef.baseid}::")
        done = yield
        self.coverage.switch_context(self.now)
        return done

    def record(self, names: Sequence[str], out: Path) -> int:
        """Run the tests; what was seen goes to a file."""
        self.coverage.start()
        code = run_tests([*names, "-k", QUICK], self)
        self.coverage.stop()
        data = self.coverage.get_data()
        lines = {
            Path(file).relative_to(ROOT).as_posix(): data.contexts_by_lineno(file)
            for file in data.measured_files()
        }
        imported = [name for name in sys.modules if name.split(".")[0] not in (*OURS, "__main__")]
        out.write_text(json.dumps({"seconds": self.seconds, "lines": lines, "imported": imported}))
        return code


def place_of(test: str) -> str:
    """Of a file of tests, or of a test in it, named as pytest does: where it is."""
    file, *inside = test.split("::")
    (path,) = (ROOT / "tests").rglob(file)
    return "::".join([path.relative_to(ROOT).as_posix(), *inside])


class Tests:
    """The quick tests of a package: which of them a mutant has to meet."""

    def __init__(self, package: str) -> None:
        self.files = [place_of(f"test_{name}") for name in TESTS[package]]
        with tempfile.TemporaryDirectory() as folder:
            seen = Path(folder) / "seen.json"
            code = forked(lambda: Recorder(package).record(self.files, seen), 3600)
            assert code == 0, "a test fails as it is"
            document = json.loads(seen.read_text())
        self.seconds: dict[str, float] = document["seconds"]
        self._lines: dict[str, dict[str, list[str]]] = document["lines"]
        for name in document["imported"]:  # once, for all mutants
            with suppress(Exception):  # what only a test can import
                importlib.import_module(name)

    def of(self, mutant: Mutant) -> list[str]:
        """Tests that run the changed lines, quickest first, within the budget."""
        contexts: set[str] = set()
        first, last = mutant.lines
        for line in range(first, last + 1):
            contexts |= set(self._lines.get(mutant.path, {}).get(str(line), ()))
        files = {context[:-2] for context in contexts if context.endswith("::")}
        chosen = [name for name in self.seconds if name in contexts or name.split("::")[0] in files]
        chosen.sort(key=self.seconds.__getitem__)
        if "" in contexts:  # it runs when the module is imported, and any test may need what it made
            chosen += sorted(self.seconds.keys() - set(chosen), key=self.seconds.__getitem__)
        spent = 0.0
        for k, name in enumerate(chosen):
            spent += self.seconds[name]
            if k and spent > BUDGET:
                return chosen[:k]
        return chosen

    def notice(self, mutant: Mutant) -> bool:
        """Whether one of the tests fails, or does not end."""
        chosen = self.of(mutant)

        def work() -> int:
            for name in list(sys.modules):
                if name.split(".")[0] in OURS:
                    del sys.modules[name]
            sys.meta_path.insert(0, Mutation(mutant))
            return run_tests(chosen)

        usual = sum(self.seconds[name] for name in chosen)
        return bool(chosen) and forked(work, PATIENCE * (usual + 2.0)) != 0


def try_all(
    package: str, chosen: list[Mutant], known: dict[str, Any], keep: Callable[[], object]
) -> Counter[str]:
    """Each mutant once; survivors are printed."""
    tests, counts = Tests(package), Counter[str]()
    for k, mutant in enumerate(chosen, start=1):
        if known.get(mutant.key()) != "caught":
            known[mutant.key()] = "caught" if tests.notice(mutant) else "survived"
            keep()
        outcome = known[mutant.key()]
        counts[outcome] += 1
        if outcome == "survived":
            print(f"{mutant.path}:{mutant.lines[0]} #{mutant.number}: {mutant.text[:200]}", flush=True)
        print(f"{package} {k}/{len(chosen)} {dict(counts)}", end="\r", file=sys.stderr)
    return counts


@command
def main(
    packages: Annotated[list[str], "all by default", TESTS] = list(TESTS),  # noqa: B006
    *,
    count: Annotated[int, "mutants per package"] = 200,
    seed: int = 1,
    out: Path = ROOT / "build" / "mutants.json",
) -> None:
    known = json.loads(out.read_text()) if out.exists() else {}
    out.parent.mkdir(parents=True, exist_ok=True)
    for package in packages:
        chosen = mutants(package, count, seed)
        counts = try_all(package, chosen, known, lambda: out.write_text(json.dumps(known, indent=0)))
        share = 100 * counts["caught"] / len(chosen)
        print(f"{package}: {len(chosen)} tried, {counts['caught']} caught ({share:.0f} %)", flush=True)


if __name__ == "__main__":
    sys.exit(main())
