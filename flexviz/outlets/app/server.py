"""A viser server that validates all values that browsers send; `access` decides who may reach it."""

from __future__ import annotations

import contextlib
import io
import logging
import socket
from collections.abc import Sequence

import viser

from flexviz.base.errors import InputError
from flexviz.outlets.app.access import Access, guarded_serve, is_loopback
from flexviz.outlets.app.viser_private import guard_messages, guard_uploads
from flexviz.outlets.doctor import APP_PORT


def start_server(
    host: str = "127.0.0.1", port: int | None = None, token: str = "", names: Sequence[str] = ()
) -> viser.ViserServer:
    """Listen on `host`; without a port on 8080 or the next free one. A given port must be free (0: any).

    Where other machines can reach it, by itself or by `names` of a proxy, browsers must show the `token`.
    """
    access = Access()
    logging.getLogger("websockets.server").addFilter(is_of_interest)
    if token or names or not is_loopback(host):
        from flexviz.outlets.app.network import NetworkAccess, limit_logs

        access = NetworkAccess(host, token, tuple(names))
        limit_logs()
    if port is not None and not 0 <= port <= 65535:
        raise InputError(f"port {port} does not exist; expected 0 to 65535")
    check_free(host, port or 0)
    with guarded_serve(access), contextlib.redirect_stdout(io.StringIO()):  # hides viser's banner
        server = viser.ViserServer(
            host=host, port=APP_PORT if port is None else port, label="flexviz", verbose=False
        )
    guard_messages(server)
    guard_uploads(server)
    return server


def is_of_interest(record: logging.LogRecord) -> bool:
    """Whether websockets has something to say: browsers also open connections that they never use."""
    return record.msg != "opening handshake failed"


def check_free(host: str, port: int) -> None:
    """Raise InputError if nothing can listen on this port of this host."""
    try:
        family, kind, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
    except OSError as error:
        raise InputError(f"cannot listen on {host}:{port} ({error.strerror or error})") from None
