"""A viser server that only this machine's user can talk to."""

from __future__ import annotations

import contextlib
import io
import socket

import viser

from flexviz.app.gate import guard_messages, guarded_serve
from flexviz.errors import InputError

DEFAULT_PORT = 8080


def start_server(host: str = "127.0.0.1", port: int | None = None) -> viser.ViserServer:
    """Listen on `host`; without a port on 8080 or the next free one. A given port must be free (0: any)."""
    if port is not None and not 0 <= port <= 65535:
        raise InputError(f"port {port} does not exist; 0 to 65535 would be right")
    check_free(host, port or 0)
    with guarded_serve(host), contextlib.redirect_stdout(io.StringIO()):  # viser prints a banner of its own
        server = viser.ViserServer(
            host=host, port=DEFAULT_PORT if port is None else port, label="flexviz", verbose=False
        )
    guard_messages(server)
    return server


def check_free(host: str, port: int) -> None:
    """InputError where nothing can listen on this port of this host."""
    try:
        family, kind, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
    except OSError as error:
        raise InputError(f"cannot listen on {host}:{port} ({error.strerror or error})") from None
