"""Independent pieces of work on several cores, in forked processes.

A forked process has all data of this one without copying them; only results are sent back. What a killed
process was to do is done here. Processes end with a stop, and with the one that made them, also if that is
killed.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor, wait
from contextvars import ContextVar
from multiprocessing import get_context
from typing import Any, TypeVar

from flexviz.base.progress import StopCallback, never

Item = TypeVar("Item")
Result = TypeVar("Result")

MOST_CORES = 4  # more of them wait for one another
STOP_SECONDS = 0.05  # [s] between two looks whether to stop
ALONE_SECONDS = 0.15  # [s] that one core works before others join: they cost as much
_allowed: ContextVar[int] = ContextVar("cores", default=1)
_should_stop: ContextVar[StopCallback] = ContextVar("should_stop", default=never)
_libc = ctypes.CDLL(None) if sys.platform == "linux" else None
_work: tuple[Callable[[Any], Any], list[Any]]  # of a forked process


def usable_cores() -> int:
    """Cores that this process may use, at most `MOST_CORES`; 1 where processes cannot safely be forked."""
    safe = sys.platform == "linux" and hasattr(os, "fork") and hasattr(os, "sched_getaffinity")
    return min(len(os.sched_getaffinity(0)), MOST_CORES) if safe else 1


@contextlib.contextmanager
def on_cores(count: int) -> Iterator[None]:
    """Let `diagnose`, and what contains it, use up to `count` cores in this context; results are the same.

    The process is forked: it must have no other threads that compute.
    """
    token = _allowed.set(max(1, min(count, usable_cores())))
    try:
        yield
    finally:
        _allowed.reset(token)


@contextlib.contextmanager
def stopped_by(should_stop: StopCallback) -> Iterator[None]:
    """End the processes of this context once `should_stop()` is true; this one does their work."""
    token = _should_stop.set(should_stop)
    try:
        yield
    finally:
        _should_stop.reset(token)


@contextlib.contextmanager
def existing_objects_kept() -> Iterator[None]:
    """Search only objects made in this context for garbage; at its end return what it leaves to the system.

    There are tens of thousands of others, most of imported modules; forked processes would copy them. What
    is left in cycles takes tens of megabytes, and glibc keeps what lies below a block in use: 18 diagnoses of
    different two-joint sets in one process ended with 735 MB instead of 175 MB.
    """
    own = gc.get_freeze_count() == 0  # else the caller's, which stay as they are
    if own:
        gc.freeze()
    try:
        yield
    finally:
        if own:
            gc.collect()  # while it is cheap
            gc.unfreeze()
            _return_freed()


def _return_freed() -> None:
    """Return freed memory to the system, where the C library can."""
    trim = getattr(_libc, "malloc_trim", None)
    if trim is not None:
        trim(0)


def shared(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """`[function(item) for item in items]`, by several cores where they are allowed.

    What takes less than `ALONE_SECONDS` is done by one: processes cost more than they save.
    """
    work, found, futures = list(items), dict[int, Result](), dict[int, Future[Result]]()
    cores, end = _allowed.get(), time.perf_counter() + ALONE_SECONDS
    with on_cores(1):
        while len(found) < len(work) and (cores == 1 or time.perf_counter() < end):
            found[len(found)] = function(work[len(found)])
    rest = range(len(found), len(work))
    count = max(1, min(cores, len(rest)))
    should_stop = _should_stop.get()
    if should_stop():  # what is done after a stop is not stopped by it
        should_stop = never
    with contextlib.ExitStack() as opened:
        if count > 1:
            with contextlib.suppress(OSError):  # no more processes or files: all is done here
                pool = opened.enter_context(_processes(function, work, count - 1))
                futures |= {k: pool.submit(_piece, k) for k in rest if k % count}
        with on_cores(1):  # no processes of processes
            found |= {k: function(work[k]) for k in rest if k not in futures}
        while wait(futures.values(), STOP_SECONDS).not_done and not should_stop():
            pass
    for k, future in futures.items():
        with contextlib.suppress(BrokenExecutor):  # killed, or stopped
            found[k] = future.result()
    return [found[k] if k in found else function(item) for k, item in enumerate(work)]


@contextlib.contextmanager
def _processes(function: Callable[[Any], Any], work: list[Any], count: int) -> Iterator[ProcessPoolExecutor]:
    """Forked processes for pieces of the work; at the end, those still at work are ended."""
    end, alive = os.pipe()
    with contextlib.ExitStack() as pipe:
        pipe.callback(os.close, end)
        pipe.callback(os.close, alive)
        with ProcessPoolExecutor(count, get_context("fork"), _begin, (function, work, end, alive)) as pool:
            try:
                yield pool
            finally:
                pipe.close()


def _begin(function: Callable[[Any], Any], work: list[Any], end: int, alive: int) -> None:
    """Prepare a forked process, which ends when no other one holds the pipe open."""
    global _work
    _work = function, work
    os.close(alive)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever waits for the results stops it
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    _allowed.set(1)
    threading.Thread(target=_end_with, args=(end,), daemon=True).start()


def _end_with(pipe: int) -> None:
    os.read(pipe, 1)
    os._exit(0)


def _piece(k: int) -> Any:
    function, work = _work
    return function(work[k])
