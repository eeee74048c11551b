"""Imports of the commands that analyse data, and reading a set meanwhile."""

from __future__ import annotations

import contextlib
import gc
import logging
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from flexviz.errors import FlexvizError

if TYPE_CHECKING:
    from flexviz.measurements import MeasurementSet


log = logging.getLogger(__name__)


@contextlib.contextmanager
def loading() -> Iterator[None]:
    """Import without searches for garbage, which take an eighth of the time and find none."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


class ReadMeanwhile:
    """A measurement set that another core reads, and then checks, while this one does other work.

    To be made before other threads are, in a context where several cores are allowed (`on_cores`).
    """

    def __init__(self, path: Path) -> None:
        with loading():  # what both need is loaded before there are two of it
            from flexviz.measurements import read_set
            from flexviz.parallel import Background

        self._reading = Background(partial(_read, read_set, path))
        self._checking: Background[list[str]] | None = None

    def result(self) -> MeasurementSet:
        """The set. To be asked for once."""
        from flexviz.parallel import Background

        found = self._reading.result()
        if isinstance(found, FlexvizError):
            raise found
        self._checking = Background(partial(_contradictions, found), spare=True)
        return found

    def warn(self, wait: bool = False) -> None:
        """Log what the masses of the set's robot contradict, if that is known by now."""
        checking = self._checking
        if checking is not None and (wait or checking.ready):
            self._checking = None
            for text in checking.result():
                log.warning("%s", text)


def _read(read_set: Callable[[Path], MeasurementSet], path: Path) -> MeasurementSet | FlexvizError:
    """The set, or why it cannot be used: a copy of the process that raises would send nothing."""
    try:
        return read_set(path)
    except FlexvizError as error:
        return error


def _contradictions(measurements: MeasurementSet) -> list[str]:
    with loading():
        from flexviz.importing import plausibility_warnings

    return plausibility_warnings(measurements)
