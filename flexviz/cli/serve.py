"""`flexviz serve [SET|SESSION]`: the app in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flexviz.cli.options import EffectsFromOption, load_effect_files


def serve(
    source: Annotated[
        Path | None,
        typer.Argument(
            metavar="SET|SESSION",
            help="Folder with measurements.toml or session.json; default: a bundled example.",
        ),
    ] = None,
    port: Annotated[
        int | None,
        typer.Option(metavar="P", help="Port to listen on; default: 8080 or the next free one."),
    ] = None,
    host: Annotated[str, typer.Option(metavar="H", help="Address to listen on.")] = "127.0.0.1",
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page in a browser.")
    ] = True,
    effects_from: EffectsFromOption = None,
) -> int:
    """Show measured and identified motion side by side in the browser; Ctrl+C ends it."""
    from flexviz.app import serve as run

    load_effect_files(effects_from)
    run(source, host=host, port=port, open_browser=browser)
    return 0
