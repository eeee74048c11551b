"""Results on standard output and in files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from flexviz.errors import InputError, choose_from
from flexviz.files import as_json, write_whole

if TYPE_CHECKING:
    from flexviz.results import ResultDocument

PIPE_WIDTH = 160  # columns where standard output is not a terminal


def results() -> Console:
    """A console on standard output; names are shown as they are, brackets are not markup."""
    console = Console(markup=False, highlight=False, emoji=False)
    if not console.is_terminal:
        console.width = PIPE_WIDTH
    return console


def check_output_file(path: Path | None, suffix: str = "") -> None:
    """Say before the work, not after it, that a file cannot be written where it was asked for.

    With `suffix` a file that ends otherwise is not overwritten: it may be the set's, or a robot.
    """
    if path is None:
        return
    if path.is_dir():
        raise InputError("is a folder; a file name is needed", file=path)
    if not path.absolute().parent.is_dir():
        raise InputError(f"the folder {path.absolute().parent} does not exist", file=path)
    if suffix and path.is_file() and path.suffix not in ("", suffix):
        raise InputError(f"is there already and is no {suffix} file; another name would be right", file=path)


def check_new_folder(folder: Path, table_format: str) -> None:
    """Say before the work that a set cannot be written to this folder or in this format."""
    from flexviz.measurements import SUFFIXES, check_free

    if table_format not in SUFFIXES:
        raise InputError(f"--format {table_format}: {choose_from(table_format, SUFFIXES)}")
    check_free(folder.absolute())


def show(result: ResultDocument) -> None:
    """A result as tables and sentences."""
    from flexviz.results import parts

    console = results()
    for part in parts(result, console.width):
        console.print(part, soft_wrap=isinstance(part, str))


def write_json(path: Path, data: Any) -> None:
    """Write JSON so that the file is either whole or not there; NaN and infinities become null."""
    write_whole(path, as_json(data).encode())
