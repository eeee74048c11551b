"""Who may reach the server: Host and Origin of every request, and the headers of every answer.

viser checks none of these. What a server needs that other machines can reach is in `network`.
"""

from __future__ import annotations

import http
import ipaddress
import logging
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any
from urllib.parse import urlsplit

from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from flexviz.outlets.app.viser_private import Handler, served_by

log = logging.getLogger("flexviz.outlets.app")
TOKEN = "token"  # in the query of the address that is printed
PAGE_HEADERS = {
    "X-Frame-Options": "DENY",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    # the page runs WebAssembly, workers and inline styles of its own, and nothing from elsewhere
    "Content-Security-Policy": "default-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob:; "
    "connect-src 'self' ws: wss: data: blob:; object-src 'none'; base-uri 'self'; frame-ancestors 'none'",
}


def is_loopback(host: str) -> bool:
    """True for localhost and loopback addresses."""
    address = host_address(host.strip("[]"))
    return host == "localhost" or (address is not None and address.is_loopback)


def host_address(host: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    """The address of a host that is given by its number; None for a name."""
    try:
        return ipaddress.ip_address(host)
    except ValueError:
        return None


class Access:
    """The rule of a server that listens on loopback."""

    def is_own(self, name: str) -> bool:
        """Whether a Host means this server."""
        return is_loopback(name)

    def admits(self, host: str | None, origin: str | None) -> bool:
        """Whether a request with these Host and Origin headers may reach the server.

        Pages of other sites must not: Host must be a name or an address of this server (no DNS rebinding),
        and an Origin must equal the Host.
        """
        try:
            parts = urlsplit(f"//{host or ''}")
            name, _ = parts.hostname or "", parts.port  # ValueError where there is no such port
            own = self.is_own(name)
            return own and (origin is None or urlsplit(origin).netloc.lower() == str(host).lower())
        except ValueError:  # no host: "[", a port of letters
            return False

    def check(self, request: Request) -> Response | None:
        """The answer to a request that is not let through, or None."""
        hosts, origins = request.headers.get_all("Host"), request.headers.get_all("Origin")
        once = len(hosts) == 1 and len(origins) <= 1
        if once and self.admits(hosts[0], origins[0] if origins else None):
            return None
        log.warning("refused a request for Host %r from Origin %r", hosts, origins)
        return answer(http.HTTPStatus.FORBIDDEN, b"this address is not served\n")

    def handler(self, handler: Handler) -> Handler:
        """What handles a connection."""
        return handler


def answer(status: http.HTTPStatus, body: bytes, headers: dict[str, str] | None = None) -> Response:
    """An answer of plain text."""
    sent = {"Content-Length": str(len(body)), "Content-Type": "text/plain; charset=utf-8"}
    return Response(status.value, status.phrase, Headers(sent | PAGE_HEADERS | (headers or {})), body)


def guarded_serve(access: Access) -> AbstractContextManager[None]:
    """Add the checks of requests, and the headers, to a ViserServer started in this context."""

    def serve(
        original: Callable[..., Any],
        handler: Handler,
        *args: Any,
        process_request: Callable[..., Any] | None = None,
        **kwargs: Any,
    ) -> Any:
        def check_first(connection: Any, request: Request) -> Response | None:
            refusal = access.check(request)
            if refusal is not None or process_request is None:
                return refusal
            response = process_request(connection, request)
            if response is not None:
                response.headers.update(PAGE_HEADERS)
            return response

        return original(access.handler(handler), *args, process_request=check_first, **kwargs)

    return served_by(serve)
