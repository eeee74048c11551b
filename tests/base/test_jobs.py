"""The worker: progress, results, failures, stopping, a process that dies."""

from __future__ import annotations

import math
import os
import queue
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from flexviz.base.errors import Cancelled, FlexvizError, InputError
from flexviz.base.jobs import InThread, JobEvent, Task, Worker
from flexviz.base.parallel import ALONE_SECONDS, shared, usable_cores
from flexviz.base.progress import Progress, ProgressCallback, StopCallback
from flexviz.outlets.app.events import EventQueue, TaskRunner

PATIENCE = 300.0  # [s] for anything; a test that waits so long has failed


@dataclass(frozen=True)
class Count(Task[int]):
    top: int

    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> int:
        for i in range(self.top):
            progress(Progress(share=i))
        return self.top


class OtherCount(Count):
    pass


class WaitUntilStopped(Task[str]):
    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> str:
        progress(Progress("waiting"))
        while not should_stop():
            time.sleep(0.005)
        return "what was there"


class GiveUp(Task[None]):
    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> None:
        while not should_stop():
            time.sleep(0.005)
        raise Cancelled


class BadInput(Task[None]):
    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> None:
        raise InputError("no such column", file="a.csv")


class Mistake(Task[None]):
    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> None:
        raise ZeroDivisionError("by\nnothing")


class Die(Task[None]):
    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> None:
        os._exit(3)


class ProcessNumber(Task[tuple[int, str | None]]):
    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> tuple[int, str | None]:
        return os.getpid(), os.environ.get("OMP_NUM_THREADS")


class WasteTime(Task[None]):
    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> None:
        progress(Progress("begun"))
        time.sleep(600)


@dataclass(frozen=True)
class Conclude(Task[str]):
    """Takes this long [s] to conclude what it has found."""

    seconds: float

    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> str:
        progress(Progress("begun"))
        while not should_stop():
            time.sleep(0.005)
        time.sleep(self.seconds)
        return "what was found"


@dataclass(frozen=True)
class ShareForEver(Task[None]):
    """Work for two cores without an end; who works writes its number to a file."""

    folder: Path

    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> None:
        def piece(number: int) -> None:
            if number == 0:  # done by one, which finds that there is enough to do for two
                return time.sleep(2 * ALONE_SECONDS)
            (self.folder / str(os.getpid())).touch()
            progress(Progress("x" * 1_000_000))  # a copy is silent, or it would mix with others
            time.sleep(600)

        shared(piece, range(3))


def placed(task: Task[Any], in_process: bool) -> Task[Any]:
    """The task, to be run in the child process or in a thread."""
    object.__setattr__(task, "in_process", in_process)
    return task


class Ears:
    """Collects a worker's events."""

    def __init__(self) -> None:
        self.events: queue.Queue[JobEvent] = queue.Queue()

    def __call__(self, event: JobEvent) -> None:
        self.events.put(event)

    def until_end(self) -> tuple[list[Any], JobEvent]:
        values = []
        while True:
            event = self.events.get(timeout=PATIENCE)
            if event.kind == "progress":
                values.append(event.value)
            else:
                return values, event

    def until_progress(self) -> Progress:
        while (event := self.events.get(timeout=PATIENCE)).kind != "progress":
            pass
        return event.value


@pytest.fixture
def worker():
    worker = Worker()
    yield worker
    worker.close()


@pytest.mark.parametrize("in_process", [True, False])
def test_progress_and_result(worker: Worker, in_process: bool) -> None:
    ears = Ears()
    worker.submit(placed(Count(5), in_process), ears)
    values, end = ears.until_end()
    assert [news.share for news in values] == [0, 1, 2, 3, 4]
    assert (end.kind, end.value) == ("done", 5)
    assert not worker.busy


@pytest.mark.parametrize("in_process", [True, False])
@pytest.mark.parametrize(
    "kind, reason", [(BadInput, "a.csv: no such column"), (Mistake, "ZeroDivisionError: by nothing")]
)
def test_failure_gives_one_line_and_the_worker_goes_on(
    worker: Worker, in_process: bool, kind: type[Task[None]], reason: str
) -> None:
    ears = Ears()
    worker.submit(placed(kind(), in_process), ears)
    _, end = ears.until_end()
    assert (end.kind, end.value) == ("failed", reason)
    worker.submit(placed(Count(2), in_process), ears)
    assert ears.until_end()[1].value == 2


@pytest.mark.parametrize("in_process", [True, False])
def test_stop_keeps_a_partial_result(worker: Worker, in_process: bool) -> None:
    ears = Ears()
    worker.submit(placed(WaitUntilStopped(), in_process), ears)
    assert ears.until_progress().text == "waiting"
    worker.stop(Count)  # not this one
    worker.stop(WaitUntilStopped)
    _, end = ears.until_end()
    assert (end.kind, end.value) == ("done", "what was there")


def test_modules_in_the_current_folder_are_not_imported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("numpy", "dataclasses", "multiprocessing"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit(9)", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    worker, ears = Worker(), Ears()
    worker.submit(Count(2), ears)
    assert ears.until_end()[1].value == 2
    worker.close()


def test_stop_without_result(worker: Worker) -> None:
    ears = Ears()
    worker.submit(GiveUp(), ears)
    worker.stop()
    assert ears.until_end()[1].kind == "stopped"


def test_a_waiting_job_gives_way_to_a_newer_one_of_its_class(worker: Worker) -> None:
    first, old, other, new = Ears(), Ears(), Ears(), Ears()
    worker.submit(WaitUntilStopped(), first)
    worker.submit(Count(1), old)
    worker.submit(OtherCount(3), other)
    worker.submit(Count(2), new)
    assert old.until_end()[1].kind == "stopped"
    worker.stop(WaitUntilStopped)
    assert other.until_end()[1].value == 3 and new.until_end()[1].value == 2


def test_a_dead_process_is_reported_and_replaced(worker: Worker) -> None:
    ears = Ears()
    worker.submit(Die(), ears)
    _, end = ears.until_end()
    assert end.kind == "failed" and "ended unexpectedly (exit code 3)" in end.value
    worker.submit(Count(3), ears)
    assert ears.until_end()[1].value == 3


def test_a_job_that_does_not_stop_is_ended(worker: Worker, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("flexviz.base.jobs.STOP_GRACE", 0.3)
    ears = Ears()
    worker.submit(WasteTime(), ears)
    assert ears.until_progress().text == "begun"
    worker.stop()
    assert ears.until_end()[1].kind == "stopped"
    worker.submit(Count(1), ears)
    assert ears.until_end()[1].value == 1


def test_what_a_user_stops_may_take_its_time_until_stopped_again(
    worker: Worker, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("flexviz.base.jobs.STOP_GRACE", 0.1)
    for seconds, again, kind in ((1.0, False, "done"), (600.0, True, "stopped")):
        ears = Ears()
        worker.submit(Conclude(seconds), ears)
        assert ears.until_progress().text == "begun"
        worker.stop(grace=math.inf)
        if again:
            worker.stop(grace=0.0)
        assert ears.until_end()[1].kind == kind


def test_one_other_process_with_one_thread(worker: Worker) -> None:
    ears = Ears()
    numbers = []
    for _ in range(2):
        worker.submit(ProcessNumber(), ears)
        numbers.append(ears.until_end()[1].value)
    assert numbers[0] == numbers[1]
    assert numbers[0][0] != os.getpid() and numbers[0][1] == "1"


def test_what_cannot_be_sent_fails_and_nothing_hangs(worker: Worker) -> None:
    ears = Ears()

    class Local(Count):
        """A class that the child cannot import."""

    worker.submit(Local(1), ears)
    assert ears.until_end()[1].kind == "failed"


def test_a_listener_that_fails_does_not_end_the_worker(worker: Worker, capsys: Any) -> None:
    def deaf(event: JobEvent) -> None:
        raise RuntimeError("deaf")

    worker.submit(placed(Count(1), False), deaf)
    ears = Ears()
    worker.submit(placed(Count(4), False), ears)
    assert ears.until_end()[1].value == 4


def test_closed_worker_takes_no_job() -> None:
    worker = Worker()
    worker.close()
    with pytest.raises(FlexvizError, match="closed"):
        worker.submit(Count(1), Ears())


def test_saving_does_not_wait_for_a_computation() -> None:
    events, told = EventQueue(), list[Any]()
    runner = TaskRunner(events, told.append)
    runner.start(WaitUntilStopped(), told.append, progress=told.append)
    runner.start(InThread(sum, (1, 2)), told.append)

    def until(count: int) -> None:
        while len(told) < count:
            event = events.take(PATIENCE)
            assert event is not None
            event.action(event.value)

    until(2)
    assert 3 in told and Progress("waiting") in told and runner.busy
    runner.stop(WaitUntilStopped)
    until(3)
    assert told[2] == "what was there"
    runner.close()
    assert not runner.busy


def test_closing_waits_for_no_job() -> None:
    worker, ears = Worker(), Ears()
    worker.submit(WasteTime(), ears)
    assert ears.until_progress().text == "begun"
    worker.close()
    assert not worker.busy and ears.until_end()[1].kind == "stopped"


def alive(number: int) -> bool:
    """Whether a process is there, and no zombie that nobody collects."""
    try:
        return Path(f"/proc/{number}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def until(condition: Callable[[], bool], seconds: float = 60.0) -> bool:
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.01)
    return condition()


@pytest.mark.skipif(usable_cores() < 2, reason="one core, or a system on which processes are not forked")
@pytest.mark.parametrize("ended_by", ["stop", "close", "kill of the worker", "kill of the server"])
def test_no_copy_outlives_its_worker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ended_by: str) -> None:
    monkeypatch.setattr("flexviz.base.jobs.STOP_GRACE", 0.3)
    worker, ears, server = Worker(), Ears(), None
    if ended_by == "kill of the server":
        code = "from tests.base.test_jobs import *; Worker().submit(ShareForEver(Path(sys.argv[1])), Ears())"
        code += "; time.sleep(600)"
        server = subprocess.Popen([sys.executable, "-c", code, str(tmp_path)])
    else:
        worker.submit(ShareForEver(tmp_path), ears)
        ears.until_progress()
    assert until(lambda: len(list(tmp_path.iterdir())) == 2)
    numbers = sorted(int(file.name) for file in tmp_path.iterdir())
    assert all(alive(number) for number in numbers)
    if server is not None:
        server.kill()
        server.wait()
    elif ended_by == "kill of the worker":
        assert worker._child is not None
        os.kill(worker._child._process.pid, signal.SIGKILL)
        values, end = ears.until_end()
        assert end.kind == "failed" and not values  # the copy has told nothing
    else:
        getattr(worker, ended_by)()
        assert ears.until_end()[1].kind == "stopped"
    assert until(lambda: not any(alive(number) for number in numbers), 5.0)
    worker.close()
