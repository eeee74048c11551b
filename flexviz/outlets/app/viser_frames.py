"""Which frames are messages of viser's; others end their connection."""

from __future__ import annotations

from dataclasses import MISSING, fields
from functools import lru_cache
from typing import Any, get_type_hints

import msgspec
from viser import _messages as messages
from websockets.asyncio.server import ServerConnection
from websockets.frames import CloseCode

from flexviz.outlets.app.viser_private import Handler, log


def only_messages(handler: Handler) -> Handler:
    """A handler of connections that receives well-formed messages only."""

    async def handle(connection: ServerConnection) -> None:
        receive = connection.recv

        async def checked(*arguments: Any, **options: Any) -> Any:
            while not is_message(data := await receive(*arguments, **options)):
                log.warning("closed a connection that sent a malformed message")
                await connection.close(CloseCode.UNSUPPORTED_DATA, "malformed message")
            return data

        connection.recv = checked  # type: ignore[method-assign]
        await handler(connection)

    return handle


def is_message(data: bytes | str) -> bool:
    """Whether a frame is one of viser's messages."""
    try:
        content = msgspec.msgpack.decode(data)  # type: ignore[arg-type]  # a text fails
        types, needed = _fields(content.pop("type"))
        for name, value in content.items():
            msgspec.convert(value, types[name])
    except Exception:  # whatever the content makes of these
        return False
    return needed <= content.keys()


@lru_cache(maxsize=200)
def _fields(name: str) -> tuple[dict[str, Any], set[str]]:
    """Types of a message's fields, and the names of those it must have."""
    kind: Any = messages.Message._subclass_from_type_string()[name]
    needed = {one.name for one in fields(kind) if one.default is one.default_factory is MISSING and one.init}
    return get_type_hints(kind), needed
