"""The door of the server: who may connect, and which messages and values come in.

viser itself checks none of this. It leans on viser's inside (the handler tables, and `serve` of the websocket
library), so viser's version is pinned and tests/test_app_gate.py holds every promise made here.
"""

from __future__ import annotations

import contextlib
import http
import ipaddress
import logging
from collections.abc import Callable, Iterator
from typing import Any
from urllib.parse import urlsplit

import viser
import websockets.asyncio.server as websocket_server
from viser import _messages as messages
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from flexviz.app.checks import Rule, check
from flexviz.app.uploads import LARGEST_UPLOAD
from flexviz.errors import InputError

log = logging.getLogger("flexviz.app")


# -- who may connect -------------------------------------------------------------------------------------


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

    A page of another site must not talk to the server of this machine: where the server listens on loopback
    the Host must be a loopback name (no DNS rebinding), and an Origin, where there is one, the Host itself.
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
    """While a ViserServer starts inside this context, its websocket server gets the Host and Origin check."""
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


# -- what may come in ------------------------------------------------------------------------------------

UNWANTED = (
    messages.ShareUrlRequest,  # opens a public tunnel
    messages.ShareUrlDisconnect,
    messages.GuiFormSubmitMessage,
    messages.GuiFormDirtyMessage,
)
MOST_UPLOADS = 4  # at the same time, of all browsers
LONGEST_NAME = 400


def guard_messages(server: viser.ViserServer) -> None:
    """Drop messages that nothing here needs, and check every value before it reaches a control."""
    websocket = server._websock_server
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
            message.updates["value"] = check(rule_of(handle), message.updates["value"])
        except InputError as error:
            log.warning("refused a value from browser %s: %s", client_id, error)
            _send_back(server, client_id, handle)
            return
        await gui._handle_gui_updates(client_id, message)

    websocket.register_handler(messages.GuiUpdateMessage, checked)
    guard_uploads(server)


def guard_uploads(server: viser.ViserServer) -> None:
    """Take uploads only for upload buttons, only so many, and only as large as they say and as is allowed."""
    websocket, gui = server._websock_server, server.gui
    states = gui._current_file_upload_states
    websocket.unregister_handler(messages.FileTransferStartUpload, gui._handle_file_transfer_start)
    websocket.unregister_handler(messages.FileTransferPart, gui._handle_file_transfer_part)

    def start(client_id: Any, message: messages.FileTransferStartUpload) -> None:
        uuid = message.source_component_uuid
        handle = gui._gui_input_handle_from_uuid.get(uuid) if isinstance(uuid, str) else None
        if refusal := upload_refusal(handle, message, len(states)):
            log.warning("refused an upload from browser %s: %s", client_id, refusal)
            return
        gui._handle_file_transfer_start(client_id, message)

    def part(client_id: Any, message: messages.FileTransferPart) -> None:
        known = isinstance(message.transfer_uuid, str) and message.transfer_uuid in states
        state = states[message.transfer_uuid] if known else None
        if state is None or state["client_id"] != client_id:
            return
        index, content = message.part_index, message.content
        fits = isinstance(content, bytes) and isinstance(index, int) and not isinstance(index, bool)
        if not fits or state["transferred_bytes"] + len(content) > state["total_bytes"]:
            log.warning("dropped an upload from browser %s: it is not what it said", client_id)
            states.pop(message.transfer_uuid, None)
            return
        gui._handle_file_transfer_part(client_id, message)

    websocket.register_handler(messages.FileTransferStartUpload, start)
    websocket.register_handler(messages.FileTransferPart, part)


def upload_refusal(handle: Any, message: Any, running: int) -> str:
    """Why an upload is not taken, or ""."""
    if not isinstance(handle, viser.GuiUploadButtonHandle) or handle.disabled:
        return "nothing is uploaded here"
    size, parts = message.size_bytes, message.part_count
    if any(not isinstance(number, int) or isinstance(number, bool) for number in (size, parts)):
        return "size or count of parts is not a whole number"
    if not 0 <= size <= LARGEST_UPLOAD or not 0 <= parts <= size // 1024 + 1:
        return f"{size} bytes in {parts} parts; at most {LARGEST_UPLOAD} bytes are taken"
    if not isinstance(message.filename, str) or not 0 < len(message.filename) <= LONGEST_NAME:
        return "no usable file name"
    if not isinstance(message.transfer_uuid, str) or len(message.transfer_uuid) > 100:
        return "no usable transfer"
    return "" if running < MOST_UPLOADS else f"{running} uploads run already"


def rule_of(handle: Any) -> Rule:
    """What a viser control accepts; unknown kinds accept nothing."""
    disabled = bool(getattr(handle, "disabled", False))
    if isinstance(handle, viser.GuiSliderHandle | viser.GuiNumberHandle):
        low = float("-inf") if handle.min is None else float(handle.min)
        high = float("inf") if handle.max is None else float(handle.max)
        return Rule("number", low, high, whole=isinstance(handle.value, int), disabled=disabled)
    if isinstance(handle, viser.GuiMultiSliderHandle):
        whole = all(isinstance(value, int) for value in handle.value)
        limits = float(handle.min), float(handle.max)
        return Rule("range", *limits, whole=whole, length=len(handle.value), disabled=disabled)
    if isinstance(handle, viser.GuiDropdownHandle | viser.GuiButtonGroupHandle):
        return Rule("choice", options=tuple(handle.options), disabled=disabled)
    if isinstance(handle, viser.GuiCheckboxHandle):
        return Rule("switch", disabled=disabled)
    if isinstance(handle, viser.GuiButtonHandle):
        return Rule("press", disabled=disabled)
    if isinstance(handle, viser.GuiTextHandle):
        return Rule("text", disabled=disabled)
    return Rule("none")


def _send_back(server: viser.ViserServer, client_id: Any, handle: Any) -> None:
    """Show the browser that sent a bad value the true one again."""
    client = server.get_clients().get(client_id)
    if client is not None and not handle._impl.is_button:
        update = messages.GuiUpdateMessage(handle._impl.uuid, {"value": handle.value})
        client._websock_connection.queue_message(update)
