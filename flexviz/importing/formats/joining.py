"""Several files of one run as one log: columns are `a/column` in the first, `b/column` in the second."""

from __future__ import annotations

from collections.abc import Sequence

from flexviz.importing.formats.base import Log, LogTable

LETTERS = "abc"  # of the files, in order


def joined(logs: Sequence[Log]) -> Log:
    """One log of the tables of several."""
    lettered = list(zip(LETTERS, logs, strict=False))
    return Log(
        logs[0].file.with_name(", ".join(log.file.name for log in logs)),
        logs[0].kind,
        tuple(renamed(table, letter) for letter, log in lettered for table in log.tables),
        {f"{letter}/{name}": why for letter, log in lettered for name, why in log.unusable.items()},
        tuple(f"{log.file.name}: {note}" for log in logs for note in log.notes),
        tuple(f"{letter}/{name}" for letter, log in lettered for name in log.unread),
    )


def renamed(table: LogTable, letter: str) -> LogTable:
    """A table with its file's letter before all names."""
    return LogTable(
        f"{letter}/{table.name}" if table.name else letter,
        {f"{letter}/{name}": values for name, values in table.columns.items()},
        f"{letter}/{table.clock}" if table.clock else None,
        {f"{letter}/{name}": unit for name, unit in table.units.items()},
    )
