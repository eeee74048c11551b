"""Tasks on local processes or on a cluster, by dask.distributed.

Only texts go over the wire, and a text comes back. A task whose worker is killed goes to another one; when
the scheduler is lost, the client waits for a new one and hands in what is not done.
"""

from __future__ import annotations

import concurrent.futures
import logging
import queue
import signal
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from flexviz.base.errors import FlexvizError, InputError, one_line, require_extra
from flexviz.base.progress import StopCallback, never

if TYPE_CHECKING:
    from distributed import Client

MOST_HANDED_IN = 2000  # tasks that a scheduler holds: enough for as many workers, little memory
SCHEMES = ("tcp://", "tls://")
TICK = 0.2  # [s] between two looks at a request to stop
PREFIX = "flexviz"


@dataclass(frozen=True)
class ClusterChoice:
    """Where tasks run.

    Attributes:
        workers: number of local processes, without a scheduler.
        scheduler: address of a running one, "tcp://host:port" or "tls://host:port"; "" for local processes.
        patience: [s] to wait for a scheduler that is not there (any more).
        processes: False: local threads in this process, for tests.
    """

    workers: int = 2
    scheduler: str = ""
    patience: float = 60.0
    processes: bool = True

    def __post_init__(self) -> None:
        if self.scheduler and not self.scheduler.startswith(SCHEMES):
            message = (
                f"--scheduler {self.scheduler}: expected {' or '.join(s + 'HOST:PORT' for s in SCHEMES)}"
            )
            raise InputError(message)
        if self.workers < 1:
            raise InputError(f"--workers {self.workers}: expected at least one")


@dataclass(frozen=True)
class Answer:
    """What came back for a task: its text, or why there is none."""

    name: str
    text: str = ""
    failure: str = ""


class SchedulerLost(FlexvizError):
    """No scheduler can be reached."""


def spread(
    work: Callable[[str], str],
    tasks: Iterable[tuple[str, str]],
    where: ClusterChoice,
    should_stop: StopCallback = never,
    note: Callable[[str], None] = lambda _: None,
) -> Iterator[Answer]:
    """Call `work` on the text of every task (name, text); the answers in the order in which they come.

    Ends early when `should_stop` turns true. `note` is told about lost and found schedulers. `work` is a
    function of a module that the workers can import.

    Raises:
        SchedulerLost: no scheduler for `where.patience` seconds.
        InputError: dask.distributed is not installed.
    """
    waiting = deque(tasks)
    if not waiting:
        return
    with connected(where) as client:
        yield from _Spread(client, work, waiting, where, note).answers(should_stop)


@contextmanager
def connected(where: ClusterChoice) -> Iterator[Client]:
    """A client of the scheduler, or of local workers that listen on this machine only."""
    dask, distributed = _library()
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # `note` and the answers say what matters
    quiet = {
        "distributed.logging.distributed": "critical",
        "distributed.admin.system-monitor.gil.enabled": False,
    }
    with dask.config.set(quiet):
        if not where.scheduler:
            with (
                distributed.LocalCluster(
                    n_workers=where.workers,
                    threads_per_worker=1,
                    processes=where.processes,
                    host="127.0.0.1" if where.processes else None,
                    dashboard_address="127.0.0.1:0",
                    worker_dashboard_address="127.0.0.1:0",
                    **({"preload": [__name__]} if where.processes else {}),
                ) as cluster,
                distributed.Client(cluster) as client,
            ):
                yield client
            return
        try:
            client = distributed.Client(where.scheduler, timeout=where.patience)
        except (OSError, ValueError) as error:
            reason = one_line(str(error))
            raise SchedulerLost(f"{where.scheduler}: no scheduler answers ({reason})") from None
        try:
            yield client
        finally:
            client.close(timeout=2)


def dask_setup(worker: Any) -> None:
    """Called by dask in every local worker process: Ctrl+C is for the program that has started it."""
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _library() -> tuple[Any, Any]:
    require_extra("distributed", "work on several processes")
    import dask
    import distributed

    return dask, distributed


class _Spread:
    """Tasks that wait and tasks that are handed in."""

    def __init__(
        self,
        client: Client,
        work: Callable[[str], str],
        waiting: deque[tuple[str, str]],
        where: ClusterChoice,
        note: Callable[[str], None],
    ) -> None:
        self._client, self._work, self._waiting, self._where, self._note = client, work, waiting, where, note
        self._handed_in: dict[str, tuple[Any, tuple[str, str]]] = {}  # key -> its future, the task
        self._ended: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._numbers = 0
        self._lost_at: float | None = None

    def answers(self, should_stop: StopCallback) -> Iterator[Answer]:
        while (self._waiting or self._handed_in) and not should_stop():
            if self._reachable():
                self._hand_in()
            try:
                future = self._ended.get(timeout=TICK)
            except queue.Empty:
                continue
            _, task = self._handed_in.pop(future.key)
            answer = self._answer(future, task[0])
            if answer is None:  # lost with its scheduler
                self._waiting.appendleft(task)
            else:
                yield answer
        self._client.cancel([future for future, _ in self._handed_in.values()])

    def _reachable(self) -> bool:
        if self._client.status == "running":
            if self._lost_at is not None:
                self._note("the scheduler is there again; going on")
                self._lost_at = None
            return True
        now = time.monotonic()
        if self._lost_at is None:
            self._lost_at = now
            self._note("the scheduler is lost; waiting for it to come back")
        if self._client.status == "closed" or now - self._lost_at > self._where.patience:
            message = "the scheduler is lost; finished work is kept, the same command goes on with the rest"
            raise SchedulerLost(message)
        return False

    def _hand_in(self) -> None:
        room = MOST_HANDED_IN - len(self._handed_in)
        while self._waiting and room > 0:
            task = self._waiting.popleft()
            self._numbers += 1
            key = f"{PREFIX}-{self._numbers}"
            future = self._client.submit(self._work, task[1], key=key, pure=False)
            self._handed_in[key] = future, task
            future.add_done_callback(self._ended.put)
            room -= 1

    def _answer(self, future: Any, name: str) -> Answer | None:
        """What came back; None if it was lost on the way."""
        if future.status == "cancelled":
            return None
        try:
            return Answer(name, str(future.result(timeout=self._where.patience)))
        except (concurrent.futures.CancelledError, OSError):  # also its TimeoutError
            return None
        except Exception as error:  # of the cluster: `work` returns its own failures as text
            kind = type(error).__name__
            if kind == "KilledWorker":
                reason = "its worker was killed each time, perhaps for want of memory"
            else:
                reason = one_line(f"{kind}: {error}")
            return Answer(name, failure=reason)
