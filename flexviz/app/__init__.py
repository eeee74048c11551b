"""The app in the browser; the only place that imports viser."""

from __future__ import annotations

import signal
import sys
import threading
import time
from pathlib import Path

__all__ = ["DEMO", "serve"]

DEMO = "planar-2r-demo"


def serve(
    path: Path | None = None, *, host: str = "127.0.0.1", port: int | None = None, open_browser: bool = True
) -> None:
    """Serve a measurement set (the bundled demonstration when None) until interrupted.

    Without `port` it listens on 8080 or the next free one.
    """
    from flexviz.app.application import Application
    from flexviz.app.server import is_loopback, start_server
    from flexviz.app.tasks import open_set
    from flexviz.resources import sessions_dir

    begin = time.monotonic()
    opened = open_set(sessions_dir() / DEMO if path is None else path)
    server = start_server(host, port)
    application = Application(server, opened)
    shown = f"[{host}]" if ":" in host else host
    url = f"http://{'localhost' if host in ('0.0.0.0', '::') else shown}:{server.get_port()}"
    print(f"flexviz shows {opened.measurements.name} at {url} (Ctrl+C ends it)", flush=True)
    print(f"ready after {time.monotonic() - begin:.1f} s", file=sys.stderr, flush=True)
    if not is_loopback(host):
        print("warning: anybody who can reach this machine can use this page", file=sys.stderr, flush=True)
    if open_browser:
        import webbrowser

        threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, _interrupt)
    try:
        application.run()
    finally:
        application.close()
        server.stop()


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt
