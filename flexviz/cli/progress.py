"""What a person sees while a command works, always on standard error.

A terminal gets one live line; a file or a pipe gets a plain line when the stage changes and at most one every
few seconds in between.
"""

from __future__ import annotations

import math
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import Any, Self

import rich.progress
from rich.console import Console
from rich.progress import BarColumn, SpinnerColumn, TextColumn, TimeElapsedColumn

from flexviz.progress import Iteration, Progress, StopCallback

SPARSE_SECONDS = 5.0  # [s] between two lines where there is no terminal


def note(message: str) -> None:
    """One plain line on standard error."""
    print(message, file=sys.stderr, flush=True)


def iteration_text(iteration: Iteration | None) -> str:
    """Where a solver is; empty without one."""
    if iteration is None:
        return ""
    step = "" if not math.isfinite(iteration.step) else f"  step {iteration.step:.2g}"
    return f"iteration {iteration.number}  cost {iteration.cost:.6g}{step}"


class Reporter:
    """Shows how far a piece of work is; use it as a context manager and call it with news."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._stage = ""
        self._last = -SPARSE_SECONDS
        self._bar: rich.progress.Progress | None = None
        console = Console(stderr=True)
        if console.is_terminal and not console.is_dumb_terminal:
            self._bar = rich.progress.Progress(
                SpinnerColumn(),
                TextColumn("{task.description}", markup=False),
                BarColumn(bar_width=24),
                TextColumn("{task.fields[detail]}", markup=False),
                TimeElapsedColumn(),
                console=console,
                transient=True,
            )
            self._task = self._bar.add_task(title, total=None, detail="")

    def __enter__(self) -> Self:
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    @contextmanager
    def paused(self) -> Iterator[None]:
        """While a person is asked something the live line is gone."""
        if self._bar is not None:
            self._bar.stop()
        try:
            yield
        finally:
            if self._bar is not None:
                self._bar.start()

    def __call__(self, news: Progress) -> None:
        """Show the news; a `ProgressCallback`."""
        stage, detail, fraction = news.text, iteration_text(news.iteration), news.share
        if self._bar is not None:
            self._bar.update(self._task, description=stage or self._title, detail=detail)
            if fraction is not None:
                self._bar.update(self._task, total=1.0, completed=min(max(fraction, 0.0), 1.0))
            return
        now = time.monotonic()
        if stage == self._stage and now - self._last < SPARSE_SECONDS:
            return
        self._stage, self._last = stage, now
        share = "" if fraction is None else f" {100 * fraction:.0f} %"
        note(" ".join(part for part in (f"{stage or self._title}{share}", detail) if part))


@contextmanager
def interruptible(consequence: str = "what was found so far is kept") -> Iterator[StopCallback]:
    """A `should_stop` that becomes true at the first Ctrl+C; the second one ends the program at once."""
    asked = threading.Event()

    def on_interrupt(number: int, frame: FrameType | None) -> Any:
        if asked.is_set():
            raise KeyboardInterrupt
        asked.set()
        # not print: the signal may have come in the middle of one
        os.write(2, f"stopping; {consequence} (Ctrl+C again to end at once)\n".encode())

    if threading.current_thread() is not threading.main_thread():
        yield asked.is_set
        return
    previous = signal.signal(signal.SIGINT, on_interrupt)
    try:
        yield asked.is_set
    finally:
        signal.signal(signal.SIGINT, previous)
