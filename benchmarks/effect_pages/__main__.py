"""`python -m benchmarks.effect_pages [--write]`: which files of docs/effects differ, and their renewal.

Without `--write` the exit code is 1 when one does.
"""

from __future__ import annotations

import sys
from typing import Annotated

from benchmarks.command import command
from benchmarks.effect_pages.pages import FOLDER, files


@command
def main(*, write: Annotated[bool, "write them, and remove what no effect has"] = False) -> int:
    wanted = {name: text.encode() for name, text in files().items()}
    there = {path.name: path.read_bytes() for path in FOLDER.glob("*")} if FOLDER.is_dir() else {}
    stale = sorted(name for name in wanted.keys() | there.keys() if wanted.get(name) != there.get(name))
    for name in stale:
        print(name)
        if write and name in wanted:
            FOLDER.mkdir(parents=True, exist_ok=True)
            (FOLDER / name).write_bytes(wanted[name])
        elif write:
            (FOLDER / name).unlink()
    return int(bool(stale) and not write)


if __name__ == "__main__":
    sys.exit(main())
