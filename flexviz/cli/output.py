"""Results on standard output and in files."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from flexviz.errors import InputError, choose_from
from flexviz.files import as_json, write_whole

if TYPE_CHECKING:
    from flexviz.results import ResultDocument

PIPE_WIDTH = 160  # columns where standard output is not a terminal


def results() -> Console:
    """A console on standard output; brackets are not markup."""
    console = Console(markup=False, highlight=False, emoji=False)
    if not console.is_terminal:
        console.width = PIPE_WIDTH
    return console


def check_output_file(path: Path | None, suffix: str = "") -> None:
    """Refuse an unusable output file before the work starts.

    With `suffix`, an existing file of another kind is not overwritten: it may be part of a set.
    """
    if path is None:
        return
    if path.is_dir():
        raise InputError("is a folder, expected a file name", file=path)
    if not path.absolute().parent.is_dir():
        raise InputError(f"the folder {path.absolute().parent} does not exist", file=path)
    if suffix and path.is_file() and path.suffix not in ("", suffix):
        raise InputError(f"exists and is not a {suffix} file, expected another name", file=path)


def check_new_folder(folder: Path, table_format: str) -> None:
    """Refuse an unusable folder or table format for a set before the work starts."""
    from flexviz.measurements import SUFFIXES, check_free

    if table_format not in SUFFIXES:
        raise InputError(f"--format {table_format}: {choose_from(table_format, SUFFIXES)}")
    check_free(folder.absolute())


def print_lines(lines: Iterable[str]) -> None:
    """Print lines of text, unwrapped."""
    console = results()
    for line in lines:
        console.print(line, soft_wrap=True)


def show(result: ResultDocument) -> None:
    """Print a result as tables and sentences."""
    from flexviz.results import parts

    console = results()
    for part in parts(result, console.width):
        console.print(part, soft_wrap=isinstance(part, str))


def write_json(path: Path, data: Any) -> None:
    """Write JSON atomically; NaN and infinities become null."""
    write_whole(path, as_json(data).encode())
