"""`python -m benchmarks.pictures [--out FOLDER]`: the documents' pictures of the app, taken anew.

Starts `flexviz serve` on the example and walks through it in Chromium, as a user would: the first screen,
Find the missing effect, Add and refit, Compare. The fall of the error is filmed slowly and shown at its pace.
Writes app.png, app-compare.png, report.png and the animation app.webp.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmarks.pictures.walk import pictures

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "images"


def parser() -> argparse.ArgumentParser:
    commands = argparse.ArgumentParser(prog="python -m benchmarks.pictures", description=__doc__)
    commands.add_argument("--out", type=Path, default=FOLDER, help="the folder to write to [docs/images]")
    commands.add_argument("--no-animation", action="store_true", help="only the pictures that stand still")
    return commands


def main(words: list[str] | None = None) -> int:
    chosen = parser().parse_args(words)
    chosen.out.mkdir(parents=True, exist_ok=True)
    for name, content in pictures(animated=not chosen.no_animation):
        (chosen.out / name).write_bytes(content)
        print(f"{name:16s} {len(content) / 1e3:7.0f} kB", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
