"""Make sets, and diagnose each in a process of its own: what is there is not done again."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.diagnosis_study.making import case_folder
from benchmarks.diagnosis_study.running import result_file, say, spread, write
from benchmarks.robotlike_study.cases import RobotCase
from benchmarks.robotlike_study.making import is_made, make

Json = dict[str, Any]

LONGEST = 1800.0  # [s] after that a diagnosis is stopped
POLL = 0.05  # [s] between looks at a process
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


@dataclass(frozen=True)
class Ended:
    """How a process ended.

    Attributes:
        code: its exit code; None if it was stopped.
        wall, cpu: [s]; the latter with the processes that it started and waited for.
        peak: largest resident memory [MB].
    """

    code: int | None
    wall: float
    cpu: float
    peak: float


class DiagnosisRunner:
    """Diagnoses made cases, several at a time, and writes one result file for each.

    Attributes:
        work: folder of the study.
        label: folder in `work` for the results of this version.
        timeout: [s] after that a diagnosis is stopped.
        command: the command `flexviz`.
    """

    def __init__(
        self, work: Path, label: str, timeout: float = LONGEST, command: tuple[str, ...] = COMMAND
    ) -> None:
        self.work, self.label, self.timeout, self.command = work, label, timeout, command
        self._running: set[subprocess.Popen[bytes]] = set()

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
                for process in list(self._running):
                    _kill(process)
                raise

    def one(self, name: str) -> Json:
        """Diagnose a case and write its result. The process is told nothing but the set's folder."""
        with tempfile.TemporaryDirectory() as folder:
            answer, log = Path(folder) / "answer.json", Path(folder) / "log"
            ended = self._diagnosed(case_folder(self.work, name), answer, log)
            result: Json = {"case": name, "exit": ended.code, "wall": ended.wall, "cpu": ended.cpu}
            result["peak_mb"] = ended.peak
            if answer.is_file():
                result["diagnosis"] = json.loads(answer.read_text(encoding="utf-8"))
            elif ended.code is None:
                result["error"] = f"no answer in {self.timeout:g} s"
            else:
                text = log.read_text(encoding="utf-8", errors="replace").strip()
                result["error"] = text[-400:] or f"exit code {ended.code}"
        write(result_file(self.work, name, self.label), result)
        return result

    def _diagnosed(self, case: Path, answer: Path, log: Path) -> Ended:
        began = time.monotonic()
        with log.open("wb") as errors:
            process = subprocess.Popen(
                [*self.command, "diagnose", str(case), "--apply", "--json", str(answer)],
                stdout=subprocess.DEVNULL,
                stderr=errors,
                start_new_session=True,
            )
            self._running.add(process)
            try:
                return _wait(process, began, self.timeout)
            finally:
                self._running.discard(process)

    def _done(self, name: str, retry: bool) -> bool:
        path = result_file(self.work, name, self.label)
        if not path.is_file():
            return False
        return not (retry and "error" in json.loads(path.read_text(encoding="utf-8")))


def _wait(process: subprocess.Popen[bytes], began: float, timeout: float) -> Ended:
    """Wait for the end of a process and take its own resource usage; stop it after `timeout` [s]."""
    stopped = False
    while True:
        pid, status, usage = os.wait4(process.pid, os.WNOHANG)
        if pid:
            break
        if not stopped and time.monotonic() - began > timeout:
            _kill(process)
            stopped = True
        time.sleep(POLL)
    process.returncode = os.waitstatus_to_exitcode(status)
    unit = 1.0 if sys.platform == "darwin" else 1024.0  # [bytes] of ru_maxrss
    return Ended(
        code=None if stopped else process.returncode,
        wall=time.monotonic() - began,
        cpu=usage.ru_utime + usage.ru_stime,
        peak=usage.ru_maxrss * unit / 1e6,
    )


def _kill(process: subprocess.Popen[bytes]) -> None:
    """End a process and those that it started."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


def _line(result: Json) -> str:
    cost = f"{result['wall']:.0f} s, {result['peak_mb']:.0f} MB"
    if "error" in result:
        return f"{result['error'].splitlines()[-1]}, {cost}"
    effects = result["diagnosis"]["model"]["effects"]
    return f"{result['diagnosis']['verdict']}, {len(effects)} effects, {cost}"
