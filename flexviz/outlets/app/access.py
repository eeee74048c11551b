"""Who may reach the server: Host, Origin and token of every request, and the headers of every answer.

viser checks none of these.
"""

from __future__ import annotations

import hmac
import http
import ipaddress
import logging
import re
import socket
import time
from collections.abc import Callable, Collection
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import lru_cache
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlsplit

from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from flexviz.base.errors import InputError, one_line
from flexviz.base.schemas import shown
from flexviz.outlets.app.viser_private import Handler, only_messages, served_by

log = logging.getLogger("flexviz.outlets.app")
TOKEN = "token"  # in the query of the address that is printed
LOG_PERIOD, LOG_LINES = 10.0, 20  # [s], lines of one logger in it
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
    address = _address(host.strip("[]"))
    return host == "localhost" or (address is not None and address.is_loopback)


def _address(host: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    """The address of a host that is given by its number; None for a name."""
    try:
        return ipaddress.ip_address(host)
    except ValueError:
        return None


def host_name(name: str) -> str:
    """A name that a proxy may ask for, in small letters; InputError if it is none."""
    if not re.fullmatch(r"[A-Za-z0-9]([A-Za-z0-9.-]{0,251}[A-Za-z0-9])?", name):
        raise InputError(f"{shown(name)} is no name of a host, expected one such as robots.example.org")
    return name.lower()


def admitted(bound_to: str, host: str | None, origin: str | None, names: Collection[str] = ()) -> bool:
    """Whether a request with these Host and Origin headers may reach a server bound to `bound_to`.

    Pages of other sites must not reach this server: Host must be a name or an address of this machine (no DNS
    rebinding), of loopback if the server listens on that, or one of a proxy's `names`, and an Origin must
    equal the Host.
    """
    try:
        parts = urlsplit(f"//{host or ''}")
        name, _ = parts.hostname or "", parts.port  # ValueError where there is no such port
        own = name in names or is_loopback(name) or (not is_loopback(bound_to) and is_own(name, bound_to))
        return own and (origin is None or urlsplit(origin).netloc.lower() == str(host).lower())
    except ValueError:  # no host: "[", a port of letters
        return False


def is_own(name: str, bound_to: str) -> bool:
    """Whether a Host is this machine's address or one of its names."""
    if _address(name) is not None or name == bound_to.lower():
        return True  # no other site can make a number mean this machine
    machine = socket.gethostname().lower()
    label = machine.partition(".")[0]
    return bool(name) and (name in (machine, label, f"{label}.local") or name == _full_name(machine))


@lru_cache(maxsize=1)
def _full_name(machine: str) -> str:
    """Name with the domain; asked for once, because a name server may take seconds to answer."""
    return socket.getfqdn().lower()


@dataclass(frozen=True)
class Access:
    """The rule of one server.

    Attributes:
        bound_to: the address that it is bound to.
        token: what browsers must show ("": nothing).
        names: by which a proxy before it is asked.
    """

    bound_to: str
    token: str = ""
    names: tuple[str, ...] = ()

    def check(self, request: Request) -> Response | None:
        """The answer to a request that is not let through, or None."""
        headers = request.headers
        hosts, origins = headers.get_all("Host"), headers.get_all("Origin")
        once = len(hosts) == 1 and len(origins) <= 1
        if not once or not admitted(self.bound_to, hosts[0], origins[0] if origins else None, self.names):
            log.warning("refused a request for Host %r from Origin %r", hosts, origins)
            return _answer(http.HTTPStatus.FORBIDDEN, b"this address is not served\n")
        if not self.token:
            return None
        cookie = f"flexviz_{urlsplit(f'//{hosts[0]}').port or 80}"
        if self._is_right(_cookie(headers.get_all("Cookie"), cookie)):
            return None
        if self._is_right(parse_qs(urlsplit(request.path).query).get(TOKEN, [""])[0]):
            kept = f"{cookie}={self.token}; Path=/; HttpOnly; SameSite=Strict"
            return _answer(http.HTTPStatus.SEE_OTHER, b"", {"Location": "/", "Set-Cookie": kept})
        log.warning("refused a request without the token")
        text = b"open the whole address that flexviz has printed: it ends in ?token=...\n"
        return _answer(http.HTTPStatus.FORBIDDEN, text)

    def _is_right(self, token: str) -> bool:
        return hmac.compare_digest(token.encode("utf-8", "replace"), self.token.encode())


def _cookie(headers: list[str], name: str) -> str:
    try:
        found = SimpleCookie("; ".join(headers)).get(name)
    except CookieError:
        return ""
    return "" if found is None else found.value


def _answer(status: http.HTTPStatus, body: bytes, headers: dict[str, str] | None = None) -> Response:
    sent = {"Content-Length": str(len(body)), "Content-Type": "text/plain; charset=utf-8"}
    return Response(status.value, status.phrase, Headers(sent | PAGE_HEADERS | (headers or {})), body)


def guarded_serve(access: Access) -> AbstractContextManager[None]:
    """Add the checks of requests and frames, and the headers, to a ViserServer started in this context."""

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

        return original(only_messages(handler), *args, process_request=check_first, **kwargs)

    return served_by(serve)


class RateLimit(logging.Filter):
    """Lets a logger write `LOG_LINES` per `LOG_PERIOD`, and says how many were left out.

    `short` logs one line in place of a traceback.
    """

    def __init__(self, short: bool = False) -> None:
        super().__init__()
        self._short = short
        self._begin, self._count = -LOG_PERIOD, 0

    def filter(self, record: logging.LogRecord) -> bool:
        now = time.monotonic()
        left_out = 0
        if now - self._begin >= LOG_PERIOD:
            left_out = max(self._count - LOG_LINES, 0)
            self._begin, self._count = now, 0
        self._count += 1
        if self._count > LOG_LINES:
            return False
        text = record.getMessage()
        if self._short and record.exc_info and record.exc_info[1] is not None:
            error = record.exc_info[1]
            text = one_line(f"{text} ({type(error).__name__}: {error})", 300)
            record.exc_info = None
        record.msg, record.args = text + (f" ({left_out} more were not logged)" if left_out else ""), ()
        return True


def limit_logs() -> None:
    """What browsers send cannot fill the log."""
    for name in ("flexviz.outlets.app", "websockets.server", "asyncio"):
        logger = logging.getLogger(name)
        if not any(isinstance(one, RateLimit) for one in logger.filters):
            logger.addFilter(RateLimit(short=name == "websockets.server"))
