"""`flexviz effects [NAME]`: the physical effects a model can have."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from flexviz.base.errors import InputError, choose_from
from flexviz.outlets.terminal import terminal

if TYPE_CHECKING:
    from rich.console import Console

    from flexviz.model.effects import Effect

STDOUT = Path("-")


def effects(
    name: str | None = typer.Argument(
        None, metavar="NAME", help="Show this effect in full; default: list all."
    ),
    json_file: Path | None = typer.Option(
        None,
        "--json",
        metavar="FILE",
        help="Also write them as JSON; - writes only JSON, to standard output.",
    ),
) -> int:
    """List the physical effects, or show one with its equation, bounds and signature."""
    from flexviz.content.wording import effect_json
    from flexviz.model.effects import EFFECTS

    if name is not None and name not in EFFECTS:
        raise InputError(f'effect "{name}" does not exist; {choose_from(name, EFFECTS, len(EFFECTS))}')
    shown = list(EFFECTS.values()) if name is None else [EFFECTS[name]]
    if json_file is not None:
        data = {"format": 1, "effects": [effect_json(effect) for effect in shown]}
        if json_file == STDOUT:
            escaped = "utf" not in (sys.stdout.encoding or "").lower()
            print(json.dumps(data, indent=2, ensure_ascii=escaped, allow_nan=False))
            return 0
        terminal.check_output_file(json_file, ".json")
        terminal.write_json(json_file, data)
    console = terminal.results()
    if name is None:
        list_all(console, shown)
    else:
        show_one(console, shown[0])
    return 0


def list_all(console: Console, shown: Iterable[Effect]) -> None:
    """A table with one row per effect."""
    from flexviz.content.blocks import Paragraph, table
    from flexviz.content.rendering import WIDE
    from flexviz.content.wording import parameter_text

    rows = []
    wide = console.width >= WIDE
    for effect in shown:
        parameters = ", ".join(map(parameter_text, effect.parameters))
        about = [effect.explanation, parameters] if wide else [f"{effect.explanation}\n{parameters}"]
        name = (effect.name, effect.title, effect.where)
        rows.append([*(name if wide else ["\n".join(name)]), *about])
    head = ("effect", "title", "where", "description", "parameters") if wide else ("effect", "description")
    more = "flexviz effects NAME shows one with its equation, bounds and signature."
    terminal.show_blocks([table(head, rows, fold=(3, 4) if wide else (1,)), Paragraph(more)])


def show_one(console: Console, effect: Effect) -> None:
    """Everything about one effect, as lines of text."""
    from rich.table import Table

    from flexviz.content import wording

    relation = wording.relation_text(effect)
    rows = [
        ("", effect.explanation),
        ("where", f"{effect.where}; belongs to {wording.SCOPES[effect.scope]}"),
        ("equation", effect.equation),
        ("", wording.enters_text(effect)),
    ]
    for k, p in enumerate(effect.parameters):
        text = f"{p.symbol}: {wording.parameter_text(p)}, {wording.bounds_text(p)}: {p.explanation}"
        rows.append(("parameter" if k == 0 else "", text))
    rows += [("note", relation)] if relation else []
    rows += [
        ("simulated", wording.simulated_text(effect)),
        ("signature", effect.signature),
        ("confirmed by", effect.confirm),
        ("reference", effect.reference),
    ]
    table = Table.grid(padding=(0, 2, 0, 0))
    table.add_column(no_wrap=True, style="dim")
    table.add_column(overflow="fold")
    for row in rows:
        table.add_row(*row)
    console.print(f"{effect.title} ({effect.name})", style="bold", soft_wrap=True)
    console.print(table)
