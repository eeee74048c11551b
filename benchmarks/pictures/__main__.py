"""`python -m benchmarks.pictures [--out FOLDER]`: the documents' pictures of the app, taken anew.

Starts `flexviz serve` on the example and walks through it in Chromium, as a user would: the first screen,
Find the missing effect, Add and refit, Compare. The fall of the error is filmed slowly and shown at its pace.
Writes app.png, app-compare.png, report.png and the animation app.webp.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from benchmarks.command import command
from benchmarks.pictures.walk import pictures

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "images"


@command
def main(
    *,
    out: Annotated[Path | None, "the folder to write to, docs/images by default"] = None,
    no_animation: Annotated[bool, "only the pictures that stand still"] = False,
) -> None:
    folder = out or FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in pictures(animated=not no_animation):
        (folder / name).write_bytes(content)
        print(f"{name:16s} {len(content) / 1e3:7.0f} kB", flush=True)


if __name__ == "__main__":
    sys.exit(main())
