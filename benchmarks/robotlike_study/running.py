"""Make sets, and diagnose each in a process of its own: what is there is not done again."""

from __future__ import annotations

import json
import sys
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from benchmarks.diagnose_command import DiagnoseCommand, Json
from benchmarks.diagnosis_study.making import case_folder
from benchmarks.diagnosis_study.running import result_file, spread
from benchmarks.kept_results import say, write
from benchmarks.robotlike_study.cases import RobotCase
from benchmarks.robotlike_study.making import is_made, make

LONGEST = 1800.0  # [s] after that a diagnosis is stopped
COMMAND = (sys.executable, "-m", "flexviz")


def make_all(work: Path, cases: list[RobotCase], jobs: int) -> int:
    """Simulate what is not there yet; 1 if a case failed."""
    missing = [case for case in cases if not is_made(work, case)]
    failures = 0
    arguments = [(work, case) for case in missing]
    for done, (case, failed) in enumerate(spread(make, arguments, missing, jobs), 1):
        failures += failed is not None
        say(f"{done}/{len(missing)} {case.name}{f': {failed}' if failed else ''}")
    return int(failures > 0)


def made_cases(work: Path, only: str = "") -> list[str]:
    """Names of the cases that are completely made, in the order in which they were planned."""
    names = [path.stem for path in (work / "truth").glob("*.json") if only in path.stem]
    names = [name for name in names if case_folder(work, name).is_dir()]
    return sorted(names, key=lambda name: (name.rpartition("-")[2], name))


class DiagnosisRunner:
    """Diagnoses made cases, several at a time, and writes one result file for each.

    Attributes:
        work: folder of the study.
        label: folder in `work` for the results of this version.
        command: the command `flexviz`.
    """

    def __init__(
        self, work: Path, label: str, timeout: float = LONGEST, command: tuple[str, ...] = COMMAND
    ) -> None:
        self.work, self.label, self.command = work, label, DiagnoseCommand(command, timeout)

    def run(self, names: list[str], jobs: int, retry: bool = False) -> None:
        """Diagnose the cases without a result; with `retry` also those that gave no answer."""
        missing = [name for name in names if not self._done(name, retry)]
        with ThreadPoolExecutor(jobs) as pool:
            try:
                futures = {pool.submit(self.one, name): name for name in missing}
                for count, future in enumerate(as_completed(futures), 1):
                    say(f"{count}/{len(missing)} {futures[future]}: {_line(future.result())}")
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                self.command.stop()
                raise

    def one(self, name: str) -> Json:
        """Diagnose a case and write its result. The process is told nothing but the set's folder."""
        result = {"case": name} | self.command.answer(case_folder(self.work, name))
        write(result_file(self.work, name, self.label), result)
        return result

    def _done(self, name: str, retry: bool) -> bool:
        path = result_file(self.work, name, self.label)
        if not path.is_file():
            return False
        return not (retry and "error" in json.loads(path.read_text(encoding="utf-8")))


def _line(result: Json) -> str:
    cost = f"{result['wall']:.0f} s, {result['peak_mb']:.0f} MB"
    if "error" in result:
        return f"{result['error'].splitlines()[-1]}, {cost}"
    effects = result["diagnosis"]["model"]["effects"]
    return f"{result['diagnosis']['verdict']}, {len(effects)} effects, {cost}"
