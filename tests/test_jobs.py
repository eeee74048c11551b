"""The worker: progress, results, failures, stopping, a process that dies."""

from __future__ import annotations

import os
import queue
import time
from typing import Any

import pytest

from flexviz.errors import Cancelled, FlexvizError, InputError
from flexviz.jobs import JobEvent, Worker


def count(top: int, *, progress: Any, should_stop: Any) -> int:
    for i in range(top):
        progress(i)
    return top


def wait_until_stopped(*, progress: Any, should_stop: Any) -> str:
    progress("waiting")
    while not should_stop():
        time.sleep(0.005)
    return "what was there"


def give_up(*, progress: Any, should_stop: Any) -> None:
    while not should_stop():
        time.sleep(0.005)
    raise Cancelled


def bad_input(*, progress: Any, should_stop: Any) -> None:
    raise InputError("no such column", file="a.csv")


def mistake(*, progress: Any, should_stop: Any) -> None:
    raise ZeroDivisionError("by\nnothing")


def die(*, progress: Any, should_stop: Any) -> None:
    os._exit(3)


def process_number(*, progress: Any, should_stop: Any) -> tuple[int, str | None]:
    return os.getpid(), os.environ.get("OMP_NUM_THREADS")


class Ears:
    """Collects a worker's events."""

    def __init__(self) -> None:
        self.events: queue.Queue[JobEvent] = queue.Queue()

    def __call__(self, event: JobEvent) -> None:
        self.events.put(event)

    def until_end(self, timeout: float = 30.0) -> tuple[list[Any], JobEvent]:
        values = []
        while True:
            event = self.events.get(timeout=timeout)
            if event.kind == "progress":
                values.append(event.value)
            elif event.kind != "started":
                return values, event

    def until_progress(self, timeout: float = 30.0) -> Any:
        while (event := self.events.get(timeout=timeout)).kind != "progress":
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
    job = worker.submit("count", count, 5, listener=ears, in_process=in_process)
    values, end = ears.until_end()
    assert values == [0, 1, 2, 3, 4]
    assert (end.kind, end.value, end.job) == ("done", 5, job)
    assert job.finished.wait(1.0) and job.state == "done"
    assert not worker.busy


@pytest.mark.parametrize("in_process", [True, False])
@pytest.mark.parametrize(
    "function, reason", [(bad_input, "a.csv: no such column"), (mistake, "ZeroDivisionError: by nothing")]
)
def test_failure_gives_one_line_and_the_worker_goes_on(
    worker: Worker, in_process: bool, function: Any, reason: str
) -> None:
    ears = Ears()
    worker.submit("bad", function, listener=ears, in_process=in_process)
    _, end = ears.until_end()
    assert (end.kind, end.value) == ("failed", reason)
    worker.submit("count", count, 2, listener=ears, in_process=in_process)
    assert ears.until_end()[1].value == 2


@pytest.mark.parametrize("in_process", [True, False])
def test_stop_keeps_a_partial_result(worker: Worker, in_process: bool) -> None:
    ears = Ears()
    worker.submit("fit", wait_until_stopped, listener=ears, in_process=in_process)
    assert ears.until_progress() == "waiting"
    begin = time.monotonic()
    worker.stop("another job")  # not this one
    worker.stop("fit")
    _, end = ears.until_end()
    assert (end.kind, end.value) == ("done", "what was there")
    assert time.monotonic() - begin < 2.0


def test_stop_without_result(worker: Worker) -> None:
    ears = Ears()
    worker.submit("fit", give_up, listener=ears)
    worker.stop()
    assert ears.until_end()[1].kind == "stopped"


def test_a_waiting_job_gives_way_to_a_newer_one_of_its_key(worker: Worker) -> None:
    first, old, new = Ears(), Ears(), Ears()
    worker.submit("fit", wait_until_stopped, listener=first)
    worker.submit("replay", count, 1, listener=old)
    worker.submit("replay", count, 2, listener=new)
    assert old.until_end()[1].kind == "stopped"
    worker.stop("fit")
    assert new.until_end()[1].value == 2


def test_a_dead_process_is_reported_and_replaced(worker: Worker) -> None:
    ears = Ears()
    worker.submit("die", die, listener=ears)
    _, end = ears.until_end()
    assert end.kind == "failed" and "ended unexpectedly (exit code 3)" in end.value
    worker.submit("count", count, 3, listener=ears)
    assert ears.until_end()[1].value == 3


def test_a_job_that_does_not_stop_is_ended(worker: Worker, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("flexviz.jobs.STOP_GRACE", 0.3)
    ears = Ears()
    worker.submit("stubborn", time_waster, listener=ears)
    assert ears.until_progress() == "begun"
    worker.stop()
    assert ears.until_end(5.0)[1].kind == "stopped"
    worker.submit("count", count, 1, listener=ears)
    assert ears.until_end()[1].value == 1


def time_waster(*, progress: Any, should_stop: Any) -> None:
    progress("begun")
    time.sleep(60)


def test_one_other_process_with_one_thread(worker: Worker) -> None:
    ears = Ears()
    numbers = []
    for _ in range(2):
        worker.submit("number", process_number, listener=ears)
        numbers.append(ears.until_end()[1].value)
    assert numbers[0] == numbers[1]
    assert numbers[0][0] != os.getpid() and numbers[0][1] == "1"


def test_what_cannot_be_sent_fails_and_nothing_hangs(worker: Worker) -> None:
    ears = Ears()
    worker.submit("lambda", lambda progress, should_stop: 1, listener=ears)
    assert ears.until_end()[1].kind == "failed"


def test_a_listener_that_fails_does_not_end_the_worker(worker: Worker, capsys: Any) -> None:
    def deaf(event: JobEvent) -> None:
        raise RuntimeError("deaf")

    worker.submit("count", count, 1, listener=deaf, in_process=False)
    ears = Ears()
    worker.submit("again", count, 4, listener=ears, in_process=False)
    assert ears.until_end()[1].value == 4


def test_closed_worker_takes_no_job() -> None:
    worker = Worker()
    worker.close()
    with pytest.raises(FlexvizError, match="closed"):
        worker.submit("count", count, 1, listener=Ears())


def test_closing_waits_for_no_job() -> None:
    worker, ears = Worker(), Ears()
    worker.submit("stubborn", time_waster, listener=ears)
    assert ears.until_progress() == "begun"
    begin = time.monotonic()
    worker.close()
    assert time.monotonic() - begin < 2.0 and not worker.busy
