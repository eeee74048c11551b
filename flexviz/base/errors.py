"""The project's exceptions: one root, and one-line messages that name the offending place.

Whoever gave a bad file reads one line: file, row or key, what was found, and what is expected. The command
line turns each class into an exit code (`FlexvizError.exit_code`).
"""

from __future__ import annotations

import difflib
import importlib.util
import sys
from collections.abc import Iterable
from pathlib import Path


class FlexvizError(Exception):
    """Root of every error that flexviz raises on purpose; `str(error)` is always a single line."""

    exit_code: int = 1

    def __str__(self) -> str:
        return one_line(super().__str__())


class InputError(FlexvizError, ValueError):
    """Something the user gave is wrong.

    Args:
        message: what was found and what is expected, one sentence.
        file: the file it was found in.
        place: where in the file: a key ("groups[2].payload"), a row, a column ("row 17, column tau_joint1").
    """

    exit_code = 2

    def __init__(self, message: str, *, file: str | Path | None = None, place: str | None = None) -> None:
        self.message = one_line(message)
        self.file = None if file is None else str(file)
        self.place = place
        where = ", ".join(part for part in (one_line(self.file or "", 300), place) if part)
        super().__init__(f"{where}: {self.message}" if where else self.message)


class MissingPackage(FlexvizError, ImportError):
    """A package that only some functions need is not installed; the message says how to install it."""

    exit_code = 2


EXTRAS = {"viser": "app", "rerun": "recording", "rosbags": "import", "distributed": "batch"}
"""Module that an extra of flexviz brings -> the extra."""


def require_extra(module: str, purpose: str) -> None:
    """MissingPackage naming the extra to install, unless `module` can be imported; `purpose` needs it."""
    require_package(module, purpose, f"flexviz[{EXTRAS[module]}]")


def require_package(module: str, purpose: str, install: str) -> None:
    """MissingPackage unless `module` can be imported: `purpose` needs it, `install` is what pip takes."""
    if sys.modules.get(module) is None and importlib.util.find_spec(module) is None:
        message = f"{purpose} needs {module}, which is not installed: pip install '{install}'"
        raise MissingPackage(message, name=module)


class ConvergenceError(FlexvizError):
    """A computation ran but did not converge, or diverged."""

    exit_code = 1


class Cancelled(FlexvizError):
    """The user stopped a computation that has no partial result."""

    exit_code = 130

    def __init__(self, message: str = "stopped by the user") -> None:
        super().__init__(message)


def one_line(text: str, limit: int = 1500) -> str:
    """`text` with every run of whitespace and control characters made one space, cut when very long."""
    line = " ".join("".join(character if character.isprintable() else " " for character in text).split())
    return line if len(line) <= limit else f"{line[: limit * 2 // 3]} … {line[-limit // 3 + 3 :]}"


def choose_from(found: str, valid: Iterable[str], limit: int = 12) -> str:
    """The end of an error message: a guess at what was meant, and the valid names.

    >>> choose_from("tau_join1", ["tau_joint1", "tau_joint2"])
    'did you mean "tau_joint1"? valid: tau_joint1, tau_joint2'
    """
    names = [str(name) for name in valid]
    if not names:
        return "there is nothing to choose from"
    shown = ", ".join(names[:limit]) + (f", … ({len(names)} in all)" if len(names) > limit else "")
    words = {word: name for name in reversed(names) for word in (*name.split("_"), name)}
    guess = difflib.get_close_matches(str(found)[:80], words, n=1, cutoff=0.6)
    return (f'did you mean "{words[guess[0]]}"? ' if guess else "") + f"valid: {shown}"
