"""Independent pieces of work on several cores, by forked copies of the process.

A copy has all data of the process without copying them; only results are sent back. A copy that fails or is
killed sends nothing, and its work is done in the process itself, which then meets the same error. A copy
ends with the thread that made it, also if that is killed.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from contextvars import ContextVar
from multiprocessing import Pipe
from typing import Any, Generic, TypeVar

from flexviz.progress import StopCallback, never

Item = TypeVar("Item")
Result = TypeVar("Result")

MOST_CORES = 4  # more of them wait for one another
SPARE_NICENESS = 10
STOP_SECONDS = 0.05  # [s] between two looks whether to stop, while a copy is waited for
_PR_SET_PDEATHSIG = 1
_allowed: ContextVar[int] = ContextVar("cores", default=1)
_busy: ContextVar[set[_Copy] | None] = ContextVar("busy", default=None)  # by `Background`s
_should_stop: ContextVar[StopCallback] = ContextVar("should_stop", default=never)
_libc = ctypes.CDLL(None) if sys.platform == "linux" else None


def usable_cores() -> int:
    """Cores that this process may use, at most `MOST_CORES`; 1 where processes cannot safely be forked."""
    return min(len(os.sched_getaffinity(0)), MOST_CORES) if sys.platform == "linux" else 1


@contextlib.contextmanager
def on_cores(count: int) -> Iterator[None]:
    """Let `diagnose`, and what contains it, use up to `count` cores in this context; results are the same.

    The process is forked: it must have no other threads that compute.
    """
    token = _allowed.set(max(1, min(count, usable_cores())))
    busy = _busy.set(set())
    try:
        yield
    finally:
        _busy.reset(busy)
        _allowed.reset(token)


@contextlib.contextmanager
def stopped_by(should_stop: StopCallback) -> Iterator[None]:
    """End copies that are waited for in this context once `should_stop()` is true."""
    token = _should_stop.set(should_stop)
    try:
        yield
    finally:
        _should_stop.reset(token)


@contextlib.contextmanager
def existing_objects_kept() -> Iterator[None]:
    """Search only objects made in this context for garbage; at its end return what it leaves to the system.

    There are tens of thousands of others, most of imported modules; forked copies would also copy them. What
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


class Background(Generic[Result]):
    """A function at work in a copy of the process.

    On one core, or without `begin`, it runs when asked for its result.

    Args:
        function: the work.
        begin: whether to begin now.
        spare: leave the cores to other work, and do it here if it is not done when asked for: on a busy
            machine it may hardly have begun.
    """

    def __init__(self, function: Callable[[], Result], begin: bool = True, spare: bool = False) -> None:
        self._function, self._spare = function, spare
        self._copy = _Copy(function, spare) if begin and _allowed.get() > 1 else None
        busy = _busy.get()
        if self._copy is not None and busy is not None and not spare:
            busy.add(self._copy)

    @property
    def ready(self) -> bool:
        """Whether to ask for the result is not to wait for another core."""
        return self._copy is None or self._copy.ready

    def result(self) -> Result:
        """What the function returns. To be asked for once."""
        if self._spare and not self.ready:
            self.close()
        found = self._copy.answer() if self._copy is not None else None
        self._copy = None
        return self._function() if found is None else found[0]

    def close(self) -> None:
        """End the copy."""
        if self._copy is not None:
            self._copy.kill()
            self._copy = None


def shared(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """`[function(item) for item in items]`, by several cores where they are allowed and free."""
    work = list(items)
    copies = min(_free_cores(), len(work)) - 1
    if copies < 1:
        return [function(item) for item in work]
    waiting, fill = os.pipe()
    os.write(fill, bytes(range(min(len(work), 256))))  # a byte per piece: whoever is free takes the next
    os.close(fill)

    def next_piece() -> int | None:
        taken = os.read(waiting, 1)
        return taken[0] if taken else None

    def some() -> dict[int, Result]:
        return {k: function(work[k]) for k in iter(next_piece, None)}

    running: list[_Copy] = []
    try:
        running += [_Copy(some) for _ in range(copies)]
        found = some()
        for copy in running:
            found |= (copy.answer() or ({},))[0]
    finally:
        os.close(waiting)
        for copy in running:
            copy.kill()
    return [found[k] if k in found else function(item) for k, item in enumerate(work)]


def _free_cores() -> int:
    """Allowed cores on which no `Background` is at work."""
    busy = _busy.get() or set()
    busy -= {copy for copy in busy if copy.ready}
    return max(1, _allowed.get() - len(busy))


class _Copy:
    """A copy of this process that calls a function and sends its result."""

    def __init__(self, function: Callable[[], Any], spare: bool = False) -> None:
        should_stop, parent = _should_stop.get(), os.getpid()
        # what is done after a stop is not stopped by it
        self._should_stop = never if should_stop() else should_stop
        self._number: int | None = None
        try:
            self._pipe, theirs = Pipe(duplex=False)
        except OSError:
            return
        with contextlib.suppress(OSError):  # no more processes or memory: as if it had failed
            self._number = os.fork()
        if self._number == 0:
            with contextlib.suppress(BaseException):
                _end_with(parent)
                signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever waits for the result stops this copy
                _allowed.set(1)
                if spare:
                    os.nice(SPARE_NICENESS)
                theirs.send((function(),))
            os._exit(0)  # nothing of the process that was copied is tidied up
        theirs.close()

    @property
    def ready(self) -> bool:
        """Whether it has ended or failed."""
        return self._number is None or self._pipe.poll()

    def answer(self) -> tuple[Any] | None:
        """The result in a tuple; None if the copy failed or is no longer wanted."""
        if self._number is None:
            return None
        try:
            while not self._pipe.poll(STOP_SECONDS):
                if self._should_stop():
                    return None
            return self._pipe.recv()
        except (EOFError, OSError):
            return None
        finally:
            self.kill()

    def kill(self) -> None:
        """End the copy, if it is still at work."""
        if self._number is not None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self._number, signal.SIGKILL)
            os.waitpid(self._number, 0)
            self._number = None
            self._pipe.close()


def _end_with(parent: int) -> None:
    """Have the system kill this copy when the thread that made it ends."""
    assert _libc is not None
    _libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:  # it ended before
        os._exit(0)
