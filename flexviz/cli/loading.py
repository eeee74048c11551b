"""Imports of the commands that analyse data, and reading a set meanwhile."""

from __future__ import annotations

import contextlib
import gc
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from flexviz.errors import FlexvizError

if TYPE_CHECKING:
    from flexviz.measurements import MeasurementSet


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


def read_checked(path: Path) -> MeasurementSet:
    """Read a measurement set, with warnings of what its robot's masses contradict."""
    with loading():
        from flexviz.importing import with_plausibility_warnings
        from flexviz.measurements import read_set

    return with_plausibility_warnings(read_set(path))


class ReadMeanwhile:
    """A measurement set that another core reads and checks while this one imports what analyses it.

    To be made before other threads are, in a context where several cores are allowed (`on_cores`).
    """

    def __init__(self, path: Path) -> None:
        from flexviz.parallel import Background

        self._work = Background(partial(_outcome, path))

    def result(self) -> MeasurementSet:
        """The set. To be asked for once."""
        found = self._work.result()
        if isinstance(found, FlexvizError):
            raise found
        return found


def _outcome(path: Path) -> MeasurementSet | FlexvizError:
    """The set, or why it cannot be used: a copy of the process that raises would send nothing."""
    try:
        return read_checked(path)
    except FlexvizError as error:
        return error
