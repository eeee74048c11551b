"""A server that other machines can reach: its names, its token, its frames and its log.

Loaded only with `--host` or `--public-host`.
"""

from __future__ import annotations

import hmac
import http
import logging
import re
import socket
import time
from dataclasses import dataclass
from functools import lru_cache
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs, urlsplit

from websockets.http11 import Request, Response

from flexviz.base.errors import InputError
from flexviz.base.schemas import shown
from flexviz.outlets.app.access import TOKEN, Access, answer, host_address, is_loopback, log
from flexviz.outlets.app.viser_frames import only_messages
from flexviz.outlets.app.viser_private import Handler

LOG_PERIOD, LOG_LINES = 10.0, 20  # [s], lines of one logger in it


@dataclass(frozen=True)
class NetworkAccess(Access):
    """The rule of a server that listens on `bound_to`, or behind a proxy.

    Attributes:
        bound_to: the address that it is bound to.
        token: what browsers must show.
        names: by which a proxy before it is asked, in small letters.

    Raises:
        InputError: there is no token, or a name is none.
    """

    bound_to: str
    token: str
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in self.names:
            if not re.fullmatch(r"[A-Za-z0-9]([A-Za-z0-9.-]{0,251}[A-Za-z0-9])?", name):
                raise InputError(
                    f"{shown(name)} is no name of a host, expected one such as robots.example.org"
                )
        if not self.token:
            raise InputError(f"{self.bound_to} can be reached from other machines, expected a token")

    def is_own(self, name: str) -> bool:
        """Whether a Host is loopback, a proxy's name, or this machine's address or one of its names."""
        if is_loopback(name) or name in map(str.lower, self.names):
            return True
        if is_loopback(self.bound_to):
            return False
        if host_address(name) is not None or name == self.bound_to.lower():
            return True  # no other site can make a number mean this machine
        machine = socket.gethostname().lower()
        label = machine.partition(".")[0]
        return bool(name) and (name in (machine, label, f"{label}.local") or name == _full_name(machine))

    def check(self, request: Request) -> Response | None:
        """The answer to a request that is not let through, or None."""
        if refusal := super().check(request):
            return refusal
        headers = request.headers
        host = headers["Host"]
        cookie = f"flexviz_{urlsplit(f'//{host}').port or 80}"
        if self._is_right(_cookie(headers.get_all("Cookie"), cookie)):
            return None
        if self._is_right(parse_qs(urlsplit(request.path).query).get(TOKEN, [""])[0]):
            kept = f"{cookie}={self.token}; Path=/; HttpOnly; SameSite=Strict"
            return answer(http.HTTPStatus.SEE_OTHER, b"", {"Location": "/", "Set-Cookie": kept})
        log.warning("refused a request without the token")
        text = b"open the whole address that flexviz has printed: it ends in ?token=...\n"
        return answer(http.HTTPStatus.FORBIDDEN, text)

    def _is_right(self, token: str) -> bool:
        return hmac.compare_digest(token.encode("utf-8", "replace"), self.token.encode())

    def handler(self, handler: Handler) -> Handler:
        """What handles a connection."""
        return only_messages(handler)


@lru_cache(maxsize=1)
def _full_name(machine: str) -> str:
    """Name with the domain; asked for once, because a name server may take seconds to answer."""
    return socket.getfqdn().lower()


def _cookie(headers: list[str], name: str) -> str:
    try:
        found = SimpleCookie("; ".join(headers)).get(name)
    except CookieError:
        return ""
    return "" if found is None else found.value


class RateLimit(logging.Filter):
    """Lets a logger write `LOG_LINES` per `LOG_PERIOD`, and says how many were left out."""

    def __init__(self) -> None:
        super().__init__()
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
        if left_out:
            record.msg, record.args = f"{record.getMessage()} ({left_out} more were not logged)", ()
        return True


def limit_logs() -> None:
    """What browsers send cannot fill the log."""
    for name in ("flexviz.outlets.app", "websockets.server", "asyncio"):
        logger = logging.getLogger(name)
        if not any(isinstance(one, RateLimit) for one in logger.filters):
            logger.addFilter(RateLimit())
