"""Results on standard output and in files; progress and notes on standard error."""

from __future__ import annotations

import math
import os
import signal
import sys
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, Self

from flexviz.base.errors import InputError, choose_from
from flexviz.base.files import as_json, write_file
from flexviz.base.progress import BestSoFar, Progress, StopCallback

if TYPE_CHECKING:
    import rich.progress
    from rich.console import Console

    from flexviz.content.blocks import Block
    from flexviz.content.results import ResultDocument

PIPE_WIDTH = 160  # columns where standard output is not a terminal
LINE_INTERVAL = 2.0  # [s] between two lines of a stage without a terminal


def results() -> Console:
    """A console on standard output; brackets are not markup."""
    from rich.console import Console

    console = Console(markup=False, highlight=False, emoji=False)
    if not console.is_terminal:
        console.width = PIPE_WIDTH
    return console


def print_lines(lines: Iterable[str]) -> None:
    """Print lines of text, unwrapped."""
    console = results()
    for line in lines:
        console.print(line, soft_wrap=True)


def show(result: ResultDocument) -> None:
    """Print all that is said of a result."""
    show_blocks(result.blocks())


def show_blocks(content: Iterable[Block]) -> None:
    """Print blocks on standard output."""
    from flexviz.content import rendering

    rendering.show(content, results())


def write_json(path: Path | None, data: Any) -> None:
    """Write JSON atomically, if a file is named; NaN and infinities become null."""
    if path is not None:
        write_file(path, as_json(data))


def check_output_file(path: Path | None, suffix: str = "", *, named: bool = False, new: bool = False) -> None:
    """Refuse an unusable output file before the work starts.

    Args:
        path: the file; None: nothing is written.
        suffix: an existing file of another kind is not overwritten: it may be part of a set.
        named: a new file has to have this suffix, or none.
        new: the file must not exist, because it may have been edited, and has to have the suffix.
    """
    if path is None:
        return
    if path.is_dir():
        raise InputError("is a folder, expected a file name", file=path)
    if not path.absolute().parent.is_dir():
        raise InputError(f"the folder {path.absolute().parent} does not exist", file=path)
    other = bool(suffix) and path.suffix not in (("", suffix) if not new else (suffix,))
    if other and path.is_file():
        raise InputError(f"exists and is not a {suffix} file, expected another name", file=path)
    if other and (named or new):
        raise InputError(f"expected a name that ends in {suffix}", file=path)
    if new and path.exists():
        raise InputError("exists already, expected a new name", file=path)


def check_new_folder(folder: Path, table_format: str) -> None:
    """Refuse an unusable folder or table format for a set before the work starts."""
    from flexviz.data.measurements import SUFFIXES, check_free

    if table_format not in SUFFIXES:
        raise InputError(f"--format {table_format}: {choose_from(table_format, SUFFIXES)}")
    check_free(folder.absolute())


def note(message: str) -> None:
    """One plain line on standard error."""
    print(message, file=sys.stderr, flush=True)


class Reporter:
    """Progress display: a live line on a terminal, otherwise plain lines at most every few seconds.

    A context manager that is called with news.
    """

    def __init__(self, title: str) -> None:
        import rich.progress
        from rich.console import Console

        self._title = title
        self._stage = ""
        self._so_far: BestSoFar | None = None
        self._last = -LINE_INTERVAL
        self._bar: rich.progress.Progress | None = None
        console = Console(stderr=True)
        if console.is_terminal and not console.is_dumb_terminal:
            self._bar = rich.progress.Progress(
                rich.progress.SpinnerColumn(),
                rich.progress.TextColumn("{task.description}", markup=False),
                rich.progress.BarColumn(bar_width=24),
                rich.progress.TextColumn("{task.fields[detail]}", markup=False),
                rich.progress.TimeElapsedColumn(),
                console=console,
                transient=True,
            )
            self._task = self._bar.add_task(title, total=None, detail="")

    def __enter__(self) -> Self:
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(self, *error: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Hide the live line while the user is asked."""
        self.__exit__()
        try:
            yield
        finally:
            self.__enter__()

    def __call__(self, news: Progress) -> None:
        """Show the news; a `ProgressCallback`."""
        stage, detail, solver = news.text, "", news.iteration
        if news.so_far is not None and news.so_far != self._so_far:
            self._so_far = news.so_far
            (self._bar.console.print if self._bar is not None else note)(news.so_far.running.text)
        if solver is not None:
            step = f"  step {solver.step:.2g}" if math.isfinite(solver.step) else ""
            detail = f"iteration {solver.number}  cost {solver.cost:.6g}{step}"
        elif news.rest is not None:
            detail = news.rest_text
        if self._bar is not None:
            self._bar.update(self._task, description=stage or self._title, detail=detail)
            if news.share is not None:
                self._bar.update(self._task, total=1.0, completed=min(max(news.share, 0.0), 1.0))
            return
        now = time.monotonic()
        if stage == self._stage and now - self._last < LINE_INTERVAL:
            return
        self._stage, self._last = stage, now
        share = "" if news.share is None else f"{100 * news.share:3.0f} % "
        separator = "" if not detail else " " if news.iteration is not None else ", "
        note(f"{share}{stage or self._title}{separator}{detail}")


@contextmanager
def interruptible(consequence: str = "what was found so far is kept") -> Iterator[StopCallback]:
    """A `should_stop` that turns true at the first Ctrl+C or SIGTERM; a second one interrupts at once."""
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
    # schedulers and `timeout` send SIGTERM
    previous = {number: signal.signal(number, on_interrupt) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield asked.is_set
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
