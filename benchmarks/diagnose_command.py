"""`flexviz diagnose --apply` in a process of its own: what it answers, and what that costs."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Json = dict[str, Any]

POLL = 0.05  # [s] between looks at a process


@dataclass(frozen=True)
class Ended:
    """How a process ended.

    Attributes:
        code: its exit code; None if it was stopped.
        wall, cpu: [s]; the latter with the processes that it started and waited for.
        peak: largest resident memory of one process [MB].
    """

    code: int | None
    wall: float
    cpu: float
    peak: float


class DiagnoseCommand:
    """One version of the command `flexviz`, told nothing but a set's folder.

    Attributes:
        command: words before `diagnose`.
        timeout: [s] after that a diagnosis is stopped.
        apart: run it in an empty folder and without PYTHONPATH, so that no other version's modules are found.
    """

    def __init__(self, command: tuple[str, ...], timeout: float, apart: bool = False) -> None:
        self.command, self.timeout, self.apart = command, timeout, apart
        self._running: set[subprocess.Popen[bytes]] = set()

    def answer(self, case: Path) -> Json:
        """Diagnose a set: exit, wall, cpu [s], peak_mb, and diagnosis or error."""
        with tempfile.TemporaryDirectory() as folder:
            answer, log = Path(folder) / "answer.json", Path(folder) / "log"
            ended = self._run(case.absolute(), answer, log)
            result: Json = {"exit": ended.code, "wall": ended.wall, "cpu": ended.cpu, "peak_mb": ended.peak}
            if answer.is_file():
                result["diagnosis"] = json.loads(answer.read_text(encoding="utf-8"))
            elif ended.code is None:
                result["error"] = f"no answer in {self.timeout:g} s"
            else:
                text = log.read_text(encoding="utf-8", errors="replace").strip()
                result["error"] = text[-400:] or f"exit code {ended.code}"
        return result

    def stop(self) -> None:
        """End what is running."""
        for process in list(self._running):
            kill(process)

    def _run(self, case: Path, answer: Path, log: Path) -> Ended:
        environment = {k: v for k, v in os.environ.items() if not (self.apart and k == "PYTHONPATH")}
        began = time.monotonic()
        with log.open("wb") as errors:
            process = subprocess.Popen(
                [*self.command, "diagnose", str(case), "--apply", "--json", str(answer)],
                stdout=subprocess.DEVNULL,
                stderr=errors,
                start_new_session=True,
                env=environment,
                cwd=answer.parent if self.apart else None,
            )
            self._running.add(process)
            try:
                return wait(process, began, self.timeout)
            finally:
                self._running.discard(process)


def wait(process: subprocess.Popen[bytes], began: float, timeout: float) -> Ended:
    """Wait for the end of a process and take its own resource usage; stop it after `timeout` [s]."""
    stopped = False
    while True:
        pid, status, usage = os.wait4(process.pid, os.WNOHANG)
        if pid:
            break
        if not stopped and time.monotonic() - began > timeout:
            kill(process)
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


def kill(process: subprocess.Popen[bytes]) -> None:
    """End a process and those that it started."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
