"""A viser server with access control by Host and Origin.

viser checks neither. The check wraps `serve` of the websocket library, so viser's version is pinned and
tests/test_app_input_checks.py covers every check.
"""

from __future__ import annotations

import contextlib
import http
import io
import ipaddress
import logging
import socket
from collections.abc import Callable, Iterator
from typing import Any
from urllib.parse import urlsplit

import viser
import websockets.asyncio.server as websocket_server
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from flexviz.app.input_checks import guard_messages
from flexviz.errors import InputError

log = logging.getLogger("flexviz.app")
DEFAULT_PORT = 8080


def start_server(host: str = "127.0.0.1", port: int | None = None) -> viser.ViserServer:
    """Listen on `host`; without a port on 8080 or the next free one. A given port must be free (0: any)."""
    if port is not None and not 0 <= port <= 65535:
        raise InputError(f"port {port} does not exist; expected 0 to 65535")
    check_free(host, port or 0)
    with guarded_serve(host), contextlib.redirect_stdout(io.StringIO()):  # hides viser's banner
        server = viser.ViserServer(
            host=host, port=DEFAULT_PORT if port is None else port, label="flexviz", verbose=False
        )
    guard_messages(server)
    return server


def check_free(host: str, port: int) -> None:
    """Raise InputError if nothing can listen on this port of this host."""
    try:
        family, kind, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
    except OSError as error:
        raise InputError(f"cannot listen on {host}:{port} ({error.strerror or error})") from None


def is_loopback(host: str) -> bool:
    """True for localhost and loopback addresses."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def admitted(bound_to: str, host: str | None, origin: str | None) -> bool:
    """Whether a request with these Host and Origin headers may reach a server bound to `bound_to`.

    Pages of other sites must not reach this server: if it listens on loopback, Host must be a loopback name
    (no DNS rebinding), and an Origin must equal the Host.
    """
    if not host:
        return False
    name = urlsplit(f"//{host}").hostname or ""
    if is_loopback(bound_to) and not is_loopback(name):
        return False
    if origin is None:
        return True
    return urlsplit(origin).netloc.lower() == host.lower()


@contextlib.contextmanager
def guarded_serve(bound_to: str) -> Iterator[None]:
    """Add the Host and Origin check to a ViserServer started in this context."""
    module: Any = websocket_server  # viser looks `serve` up here when it starts
    original = module.serve

    def serve(*args: Any, process_request: Callable[..., Any] | None = None, **kwargs: Any) -> Any:
        def check_first(connection: Any, request: Request) -> Response | None:
            headers = request.headers
            hosts, origins = headers.get_all("Host"), headers.get_all("Origin")
            once = len(hosts) == 1 and len(origins) <= 1
            if not once or not admitted(bound_to, hosts[0], origins[0] if origins else None):
                log.warning("refused a request for Host %r from Origin %r", hosts, origins)
                return Response(
                    http.HTTPStatus.FORBIDDEN, "FORBIDDEN", Headers(), b"this address is not served\n"
                )
            return None if process_request is None else process_request(connection, request)

        return original(*args, process_request=check_first, **kwargs)

    module.serve = serve
    try:
        yield
    finally:
        module.serve = original
