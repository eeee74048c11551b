"""`flexviz serve [SET]`: the app in the browser."""

from __future__ import annotations

from pathlib import Path

import typer


def serve(
    source: Path | None = typer.Argument(
        None, metavar="[SET]", help="Folder with measurements.toml; without it a bundled example."
    ),
    port: int | None = typer.Option(
        None, "--port", metavar="P", help="Port to listen on; without it 8080 or the next free one."
    ),
    host: str = typer.Option("127.0.0.1", "--host", metavar="H", help="Address to listen on."),
    browser: bool = typer.Option(True, "--browser/--no-browser", help="Open the page in a browser."),
) -> int:
    """See measured and identified motion side by side in the browser; Ctrl+C ends it."""
    from flexviz.app import serve as run

    run(source, host=host, port=port, open_browser=browser)
    return 0
