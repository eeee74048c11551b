"""Independent pieces of work on several cores, by forked copies of the process.

A copy has all data of the process without copying them; only results are sent back. A copy that fails or is
killed sends nothing, and its work is done in the process itself, which then meets the same error.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from contextvars import ContextVar
from multiprocessing import Pipe
from typing import Any, Generic, TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

MOST_CORES = 4  # more of them wait for one another
_allowed: ContextVar[int] = ContextVar("cores", default=1)


def usable_cores() -> int:
    """Cores that this process may use, at most `MOST_CORES`; 1 where processes cannot safely be forked."""
    return min(len(os.sched_getaffinity(0)), MOST_CORES) if sys.platform == "linux" else 1


@contextlib.contextmanager
def on_cores(count: int) -> Iterator[None]:
    """Allow work in this context to be shared by up to `count` cores."""
    token = _allowed.set(max(1, min(count, usable_cores())))
    try:
        yield
    finally:
        _allowed.reset(token)


class Background(Generic[Result]):
    """A function at work in a copy of the process; on one core it runs when asked for its result."""

    def __init__(self, function: Callable[[], Result]) -> None:
        self._function = function
        self._copy = _Copy(function) if _allowed.get() > 1 else None

    def result(self) -> Result:
        """What the function returns. To be asked for once."""
        found = self._copy.answer() if self._copy is not None else None
        self._copy = None
        return self._function() if found is None else found[0]

    def close(self) -> None:
        """End the copy."""
        if self._copy is not None:
            self._copy.kill()
            self._copy = None


def shared(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """`[function(item) for item in items]`, by several cores where they are allowed."""
    work = list(items)
    copies = min(_allowed.get(), len(work)) - 1
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


class _Copy:
    """A copy of this process that calls a function and sends its result."""

    def __init__(self, function: Callable[[], Any]) -> None:
        self._pipe, theirs = Pipe(duplex=False)
        self._number: int | None = os.fork()
        if self._number == 0:
            with contextlib.suppress(BaseException):
                signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever waits for the result stops this copy
                _allowed.set(1)
                theirs.send((function(),))
            os._exit(0)  # nothing of the process that was copied is tidied up
        theirs.close()

    def answer(self) -> tuple[Any] | None:
        """The result in a tuple; None if the copy failed."""
        try:
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
