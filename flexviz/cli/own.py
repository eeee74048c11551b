"""`--effects-from FILE`: effects of one's own, for every command that names effects."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

EffectsFromOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--effects-from",
        metavar="FILE",
        help="Python file with effects of your own; it is run as a program: give only files you trust. "
        "Repeat for more.",
    ),
]


def load_own(files: Sequence[Path] | None) -> None:
    """Add the effects in these files to the library."""
    if not files:
        return
    from flexviz.effects import load_effects

    for file in files:
        load_effects(file)
