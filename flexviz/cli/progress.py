"""Progress on standard error: a live line on a terminal, otherwise plain lines at most every few seconds."""

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

LINE_INTERVAL = 5.0  # [s] between two lines of a stage without a terminal


def note(message: str) -> None:
    """One plain line on standard error."""
    print(message, file=sys.stderr, flush=True)


def iteration_text(iteration: Iteration | None) -> str:
    """State of a solver in words; empty for None."""
    if iteration is None:
        return ""
    step = "" if not math.isfinite(iteration.step) else f"  step {iteration.step:.2g}"
    return f"iteration {iteration.number}  cost {iteration.cost:.6g}{step}"


class Reporter:
    """Progress display: a context manager that is called with news."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._stage = ""
        self._last = -LINE_INTERVAL
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
        """Hide the live line while the user is asked."""
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
        if stage == self._stage and now - self._last < LINE_INTERVAL:
            return
        self._stage, self._last = stage, now
        share = "" if fraction is None else f" {100 * fraction:.0f} %"
        note(" ".join(part for part in (f"{stage or self._title}{share}", detail) if part))


@contextmanager
def interruptible(consequence: str = "what was found so far is kept") -> Iterator[StopCallback]:
    """A `should_stop` that turns true at the first Ctrl+C; a second one interrupts at once."""
    asked = threading.Event()

    def on_interrupt(number: int, frame: FrameType | None) -> Any:
        if asked.is_set():
            raise KeyboardInterrupt
        asked.set()
        # not print: the signal may interrupt one
        os.write(2, f"stopping; {consequence} (Ctrl+C again to end at once)\n".encode())

    if threading.current_thread() is not threading.main_thread():
        yield asked.is_set
        return
    previous = signal.signal(signal.SIGINT, on_interrupt)
    try:
        yield asked.is_set
    finally:
        signal.signal(signal.SIGINT, previous)
