"""Work in other processes: results in files, progress in lines, `flexviz diagnose` and what it costs."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any, TypeVar

Json = dict[str, Any]
T = TypeVar("T")

POLL = 0.05  # [s] between looks at a process
COMMAND = (sys.executable, "-m", "flexviz")
LONGEST = 1800.0  # [s] after that a diagnosis is stopped


def say(text: str) -> None:
    """A line of progress."""
    print(text, file=sys.stderr, flush=True)


def read(path: Path) -> Json:
    """A kept result."""
    return json.loads(path.read_text(encoding="utf-8"))


def write(path: Path, document: Json) -> None:
    """Keep a result: all of it or nothing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_suffix(".new")
    temporary.write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    temporary.replace(path)


def case_folder(work: Path, name: str) -> Path:
    """The measurement set of a case."""
    return work / "cases" / name


def truth_file(work: Path, name: str) -> Path:
    """What is hidden in a case."""
    return work / "truth" / f"{name}.json"


def is_made(work: Path, name: str) -> bool:
    """Whether both are there; the truth is written last."""
    return truth_file(work, name).is_file() and case_folder(work, name).is_dir()


def made_cases(work: Path, only: str = "") -> list[str]:
    """Names of the cases that are completely made, in the order in which they were planned."""
    names = [path.stem for path in (work / "truth").glob("*.json") if only in path.stem]
    names = [name for name in names if is_made(work, name)]
    return sorted(names, key=lambda name: (name.rpartition("-")[2], name))


def workers(jobs: int) -> ProcessPoolExecutor:
    """Processes that begin anew, without what this one has loaded; Ctrl+C lets them finish what they do."""
    ignore = (signal.SIGINT, signal.SIG_IGN)
    context = get_context("spawn")
    return ProcessPoolExecutor(jobs, mp_context=context, initializer=signal.signal, initargs=ignore)


def alone(work: Callable[..., T], *arguments: object) -> T:
    """The result of some work in a process of its own."""
    with workers(1) as pool:
        return pool.submit(work, *arguments).result()


def as_done(pool: Executor, work: Callable[..., Any], tasks: Mapping[str, tuple[Any, ...]]) -> Iterator[str]:
    """Call `work` on the arguments of each named task; the names as they are done, with a line of progress.

    The line has what `work` returned, or why it failed. When the caller stops, what waits is cancelled.
    """
    waiting = {pool.submit(work, *given): name for name, given in tasks.items()}
    try:
        for count, future in enumerate(as_completed(waiting), 1):
            name, error = waiting[future], future.exception()
            said = f"failed, {error!r}" if error is not None else future.result()
            say(f"{count}/{len(tasks)} {name}{f': {said}' if said else ''}")
            if error is None:
                yield name
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def peak_megabytes() -> float:
    """Largest memory of this process; unlike ru_maxrss without what the parent had when it forked."""
    text = Path("/proc/self/status").read_text(encoding="ascii")
    return int(text.partition("VmHWM:")[2].split()[0]) / 1024


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


class DiagnoseCommand:
    """`diagnose --apply`, or another command, of one version of `flexviz`, told nothing but a set's folder.

    Attributes:
        command: words before the name of the command.
        timeout: [s] after that a diagnosis is stopped.
        apart: run it in an empty folder and without PYTHONPATH, so that no other version's modules are found.
    """

    def __init__(
        self, command: tuple[str, ...] = COMMAND, timeout: float = LONGEST, apart: bool = False
    ) -> None:
        self.command, self.timeout, self.apart = command, timeout, apart
        self._running: set[subprocess.Popen[bytes]] = set()

    def answer(self, case: Path) -> Json:
        """Diagnose a set: exit, wall, cpu [s], peak_mb, printed, and diagnosis or error."""
        return self.ask(case, "diagnosis", "diagnose", "--apply")

    def ask(self, case: Path, key: str, name: str, *options: str) -> Json:
        """The same of another command on a set; its document is the result's `key`."""
        with tempfile.TemporaryDirectory() as folder:
            answer, log, printed = (Path(folder) / one for one in ("answer.json", "log", "printed"))
            words = (name, str(case.absolute()), *options, "--json", str(answer))
            ended = self._run(words, Path(folder), log, printed)
            result: Json = {"exit": ended.code, "wall": ended.wall, "cpu": ended.cpu, "peak_mb": ended.peak}
            result["printed"] = printed.read_text(encoding="utf-8", errors="replace")
            if answer.is_file():
                result[key] = read(answer)
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

    def _run(self, words: tuple[str, ...], folder: Path, log: Path, printed: Path) -> Ended:
        environment = {k: v for k, v in os.environ.items() if not (self.apart and k == "PYTHONPATH")}
        began = time.monotonic()
        with log.open("wb") as errors, printed.open("wb") as output:
            process = subprocess.Popen(
                [*self.command, *words],
                stdout=output,
                stderr=errors,
                start_new_session=True,
                env=environment,
                cwd=folder if self.apart else None,
            )
            self._running.add(process)
            try:
                return wait(process, began, self.timeout)
            finally:
                self._running.discard(process)


def diagnose_all(
    sets: Mapping[str, Path], commands: Mapping[Path, DiagnoseCommand], jobs: int, retry: bool = False
) -> None:
    """Diagnose each set by each command before the next one; what is kept is not done again.

    With each set another command begins, so that all meet the machine in the same state.

    Args:
        sets: name → folder.
        commands: folder of the results → command.
        jobs: sets at a time.
        retry: also those that gave no answer.
    """
    waiting: dict[str, tuple[Path, list[Path]]] = {}
    for k, (name, folder) in enumerate(sets.items()):
        turned = [*commands][k % len(commands) :] + [*commands][: k % len(commands)]
        if missing := [out for out in turned if not _done(result_file(out, name), retry)]:
            waiting[name] = folder, missing

    def each(name: str) -> str:
        folder, missing = waiting[name]
        lines = []
        for out in missing:
            result = commands[out].answer(folder)
            write(result_file(out, name), {"case": name} | result)
            lines.append(f"{out.name} {_line(result)}")
        return "; ".join(lines)

    try:
        for _ in as_done(ThreadPoolExecutor(jobs), each, {name: (name,) for name in waiting}):
            pass
    except BaseException:
        for command in commands.values():
            command.stop()
        raise


def result_file(folder: Path, name: str) -> Path:
    """What was said of a set."""
    return folder / f"{name}.json"


def _done(path: Path, retry: bool) -> bool:
    return path.is_file() and not (retry and "error" in read(path))


def _line(result: Json) -> str:
    cost = f"{result['wall']:.0f} s, {result['cpu']:.1f} s CPU, {result['peak_mb']:.0f} MB"
    if "error" in result:
        return f"{result['error'].splitlines()[-1]}, {cost}"
    got = result["diagnosis"]
    return f"{got['verdict']}, {len(got['model']['effects'])} effects, {cost}"
