"""A viser server that validates all that browsers send; `access` decides who may reach it.

The checks lean on viser's internal handler tables, so viser's version is pinned and
tests/test_app_input_checks.py covers every check.
"""

from __future__ import annotations

import asyncio
import contextlib
import io
import logging
import math
import socket
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import viser
from viser import _messages as messages

from flexviz.app.access import Access, guarded_serve, is_loopback, limit_logs
from flexviz.app.uploads import LARGEST_UPLOAD
from flexviz.doctor import APP_PORT
from flexviz.errors import InputError
from flexviz.schemas import shown

log = logging.getLogger("flexviz.app")
LONGEST_TEXT = 2000
LARGEST_INTEGER = 2**63
UNWANTED = (
    messages.ShareUrlRequest,  # opens a public tunnel
    messages.ShareUrlDisconnect,
    messages.GuiFormSubmitMessage,
    messages.GuiFormDirtyMessage,
)
RUNNING_UPLOADS = 4  # at most, of all browsers
UPLOAD_PATIENCE = 60.0  # [s] without a part, after which an upload is given up
LONGEST_FILE_NAME = 400


def start_server(host: str = "127.0.0.1", port: int | None = None, token: str = "") -> viser.ViserServer:
    """Listen on `host`; without a port on 8080 or the next free one. A given port must be free (0: any).

    Where other machines can reach it, browsers must show the `token`.
    """
    if not token and not is_loopback(host):
        raise InputError(f"{host} can be reached from other machines, expected a token")
    if port is not None and not 0 <= port <= 65535:
        raise InputError(f"port {port} does not exist; expected 0 to 65535")
    check_free(host, port or 0)
    limit_logs()
    with (
        guarded_serve(Access(host, token)),
        contextlib.redirect_stdout(io.StringIO()),
    ):  # hides viser's banner
        server = viser.ViserServer(
            host=host, port=APP_PORT if port is None else port, label="flexviz", verbose=False
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


Rule = Callable[[Any], Any]  # the value converted to the control's type; InputError if it is invalid


def rule_of(handle: Any) -> Rule:
    """The rule of a viser control; unknown and disabled ones accept nothing."""
    if getattr(handle, "disabled", False):
        return partial(nothing, why="the control is disabled")
    if isinstance(handle, viser.GuiSliderHandle | viser.GuiNumberHandle):
        low = -math.inf if handle.min is None else float(handle.min)
        high = math.inf if handle.max is None else float(handle.max)
        return partial(number, low=low, high=high, whole=isinstance(handle.value, int))
    if isinstance(handle, viser.GuiMultiSliderHandle):
        whole = all(isinstance(value, int) for value in handle.value)
        one = partial(number, low=float(handle.min), high=float(handle.max), whole=whole)
        return partial(increasing, one=one, count=len(handle.value))
    if isinstance(handle, viser.GuiDropdownHandle | viser.GuiButtonGroupHandle):
        return partial(choice, options=tuple(handle.options))
    if isinstance(handle, viser.GuiCheckboxHandle):
        return switch
    if isinstance(handle, viser.GuiButtonHandle):
        return press
    return text if isinstance(handle, viser.GuiTextHandle) else nothing


def number(value: Any, low: float = -math.inf, high: float = math.inf, whole: bool = False) -> float | int:
    """A number between `low` and `high`."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{shown(value)} is not a number")
    if isinstance(value, int) and abs(value) > LARGEST_INTEGER:
        raise InputError("the number is too large")
    if not math.isfinite(value):
        raise InputError(f"{shown(value)} is not finite")
    slack = 1e-9 * max(abs(low), abs(high), 1.0) if math.isfinite(low + high) else 0.0
    if not low - slack <= value <= high + slack:
        raise InputError(f"{shown(value)} is not between {low:g} and {high:g}")
    if whole:
        if value != int(value):
            raise InputError(f"{shown(value)} is not a whole number")
        return int(value)
    return min(max(float(value), low), high)


def increasing(value: Any, one: Rule, count: int) -> tuple[Any, ...]:
    """`count` increasing numbers, each by the rule `one`."""
    if not isinstance(value, list | tuple) or len(value) != count:
        raise InputError(f"{shown(value)} is not a list of {count} numbers")
    numbers = tuple(one(item) for item in value)
    if list(numbers) != sorted(numbers):
        raise InputError(f"{shown(value)} does not increase")
    return numbers


def choice(value: Any, options: Sequence[str]) -> str:
    if not isinstance(value, str) or value not in options:
        raise InputError(f"{shown(value)} is not one of the {len(options)} options")
    return value


def switch(value: Any) -> bool:
    if not isinstance(value, bool):
        raise InputError(f"{shown(value)} is not true or false")
    return value


def press(value: Any) -> bool:
    if value is not True:
        raise InputError(f"a button is pressed with true, not {shown(value)}")
    return value


def text(value: Any) -> str:
    if not isinstance(value, str) or len(value) > LONGEST_TEXT:
        raise InputError(f"not a text of at most {LONGEST_TEXT} characters")
    return value


def nothing(value: Any, why: str = "this control takes no value") -> Any:
    raise InputError(why)


class LoopEvent(asyncio.Event):
    """An event that only the loop's thread sets.

    viser sets its own first in the thread that sends, and fails if a page that has gone stops waiting for it
    at that moment, then once more in the loop's thread.
    """

    def set(self) -> None:
        with contextlib.suppress(RuntimeError):
            asyncio.get_running_loop()
            super().set()


def guard_messages(server: viser.ViserServer) -> None:
    """Drop unneeded messages, and check every value before it reaches a control."""
    websocket = server._websock_server
    websocket._broadcast_buffer.message_event = LoopEvent()
    for kind in UNWANTED:
        with contextlib.suppress(AssertionError):
            websocket.unregister_handler(kind)
    gui = server.gui
    websocket.unregister_handler(messages.GuiUpdateMessage, gui._handle_gui_updates)  # type: ignore[arg-type]

    async def checked(client_id: Any, message: messages.GuiUpdateMessage) -> None:
        handle = gui._gui_input_handle_from_uuid.get(message.uuid) if isinstance(message.uuid, str) else None
        if handle is None:
            return
        try:
            if not isinstance(message.updates, dict) or set(message.updates) != {"value"}:
                raise InputError("only a control's value can be set")
            message.updates["value"] = rule_of(handle)(message.updates["value"])
        except InputError as error:
            log.warning("refused a value from browser %s: %s", client_id, error)
            _send_back(server, client_id, handle)
            return
        await gui._handle_gui_updates(client_id, message)

    websocket.register_handler(messages.GuiUpdateMessage, checked)
    guard_uploads(server)


def guard_uploads(server: viser.ViserServer) -> None:
    """Accept uploads only for upload buttons, limited in number and size."""
    websocket, gui = server._websock_server, server.gui
    states = gui._current_file_upload_states
    websocket.unregister_handler(messages.FileTransferStartUpload, gui._handle_file_transfer_start)
    websocket.unregister_handler(messages.FileTransferPart, gui._handle_file_transfer_part)

    heard: dict[str, float] = {}  # transfer -> when its last part came [s, monotonic]

    def start(client_id: Any, message: messages.FileTransferStartUpload) -> None:
        for transfer in [t for t in states if time.monotonic() - heard.get(t, 0.0) > UPLOAD_PATIENCE]:
            log.warning("gave up an upload that has stopped: %s", states.pop(transfer)["filename"])
        uuid = message.source_component_uuid
        handle = gui._gui_input_handle_from_uuid.get(uuid) if isinstance(uuid, str) else None
        if refusal := upload_refusal(handle, message, len(states)):
            log.warning("refused an upload from browser %s: %s", client_id, refusal)
            if (client := server.get_clients().get(client_id)) is not None:
                client.add_notification("Upload refused", refusal, color="red", auto_close_seconds=12)
            return
        if not states:
            heard.clear()
        heard[message.transfer_uuid] = time.monotonic()
        gui._handle_file_transfer_start(client_id, message)

    def part(client_id: Any, message: messages.FileTransferPart) -> None:
        known = isinstance(message.transfer_uuid, str) and message.transfer_uuid in states
        state = states[message.transfer_uuid] if known else None
        if state is None or state["client_id"] != client_id:
            return
        index, content = message.part_index, message.content
        fits = isinstance(content, bytes) and isinstance(index, int) and not isinstance(index, bool)
        if not fits or state["transferred_bytes"] + len(content) > state["total_bytes"]:
            log.warning("dropped an upload from browser %s: not as announced", client_id)
            states.pop(message.transfer_uuid, None)
            return
        heard[message.transfer_uuid] = time.monotonic()
        gui._handle_file_transfer_part(client_id, message)

    websocket.register_handler(messages.FileTransferStartUpload, start)
    websocket.register_handler(messages.FileTransferPart, part)


def upload_refusal(handle: Any, message: Any, running: int) -> str:
    """Why an upload is refused, or ""."""
    if not isinstance(handle, viser.GuiUploadButtonHandle) or handle.disabled:
        return "nothing is uploaded here"
    size, parts = message.size_bytes, message.part_count
    if any(not isinstance(number, int) or isinstance(number, bool) for number in (size, parts)):
        return "size or count of parts is not a whole number"
    if not 0 <= size <= LARGEST_UPLOAD or not 0 <= parts <= size // 1024 + 1:
        return f"{size} bytes in {parts} parts; at most {LARGEST_UPLOAD} bytes are taken"
    if not isinstance(message.filename, str) or not 0 < len(message.filename) <= LONGEST_FILE_NAME:
        return "no usable file name"
    if not isinstance(message.transfer_uuid, str) or len(message.transfer_uuid) > 100:
        return "no usable transfer"
    return "" if running < RUNNING_UPLOADS else f"{running} uploads run already"


def _send_back(server: viser.ViserServer, client_id: Any, handle: Any) -> None:
    """Restore the value in the browser that sent an invalid one."""
    client = server.get_clients().get(client_id)
    if client is not None and not handle._impl.is_button:
        update = messages.GuiUpdateMessage(handle._impl.uuid, {"value": handle.value})
        client._websock_connection.queue_message(update)
