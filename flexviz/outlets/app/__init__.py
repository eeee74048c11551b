"""The app in the browser; the only place that imports viser."""

from __future__ import annotations

import secrets
import signal
import socket
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from flexviz.base.errors import require_extra

if TYPE_CHECKING:
    from flexviz.outlets.app.state import Opened
    from flexviz.outlets.batch import FleetRow

__all__ = ["DEMO", "serve"]

DEMO = "planar-2r-demo"


def serve(
    path: Path | None = None,
    *,
    host: str = "127.0.0.1",
    port: int | None = None,
    open_browser: bool = True,
    public_host: Sequence[str] = (),
    since: float | None = None,
) -> None:
    """Serve a measurement set until interrupted; when None, the bundled demonstration with its model fitted.

    Of the results of a batch, the first set that can be opened is shown, and all are listed.
    Without `port` it listens on 8080 or the next free one. A proxy before it passes requests on for the names
    in `public_host`; browsers must then show the token. It says how long it took `since` (time.monotonic()),
    by default since this call.

    Raises:
        InputError: for a source that cannot be opened, a host or port on which nothing can listen, a name
            that is none.
        MissingPackage: the extra `app` is not installed.
    """
    require_extra("viser", "the app")
    from flexviz.base.resources import sessions_dir
    from flexviz.outlets.app.access import TOKEN, is_loopback
    from flexviz.outlets.app.application import Application
    from flexviz.outlets.app.server import start_server
    from flexviz.outlets.app.sets import open_set
    from flexviz.outlets.app.tasks import open_fitted
    from flexviz.outlets.batch import is_batch, read_batch

    begin = time.monotonic() if since is None else since
    fleet = read_batch(path) if path is not None and is_batch(path) else []
    if path is None:
        opened = open_fitted(sessions_dir() / DEMO)
    else:
        opened = open_first(fleet) if fleet else open_set(path)
    token = "" if is_loopback(host) and not public_host else secrets.token_urlsafe(24)
    server = start_server(host, port, token, public_host)
    application = Application(server, opened, fleet)
    shown = f"[{host}]" if ":" in host else host
    url = f"http://{'localhost' if host in ('0.0.0.0', '::') else shown}:{server.get_port()}"
    url += f"/?{TOKEN}={token}" if token else ""
    print(f"flexviz shows {opened.measurements.name} at {url} (Ctrl+C ends it)", flush=True)
    print(f"ready after {time.monotonic() - begin:.1f} s", file=sys.stderr, flush=True)
    if token:
        names = " or ".join(public_host) or f"{socket.gethostname()} or this machine's address"
        note = f"other machines reach this page with {names} in place of localhost"
        print(f"{note}; whoever has the whole address can use it", file=sys.stderr, flush=True)
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


def open_first(fleet: list[FleetRow]) -> Opened:
    """The first set of a fleet that was computed and is still there; else the error of its first set."""
    from flexviz.data.measurements import FILE_NAME
    from flexviz.outlets.app.tasks import open_set

    there = [row for row in fleet if row.state == "done" and (Path(row.path) / FILE_NAME).is_file()]
    return open_set(Path((there or fleet)[0].path))


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt
