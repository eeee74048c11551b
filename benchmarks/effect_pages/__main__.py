"""`python -m benchmarks.effect_pages [--write]`: which files of docs/effects differ, and their renewal.

Without `--write` the exit code is 1 when one does.
"""

from __future__ import annotations

import argparse
import sys

from benchmarks.effect_pages.pages import FOLDER, files


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.effect_pages", description=__doc__)
    parser.add_argument("--write", action="store_true", help="write them, and remove what no effect has")
    write = parser.parse_args().write
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
