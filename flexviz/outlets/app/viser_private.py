"""All that leans on viser's inside: handler tables, messages, its server, ids and classes of its page.

`viser_private.js` is what the page's scripts know of it. Tried with the version that pyproject.toml pins:
tests/outlets/test_app_input_checks.py and tests/browser/test_viser_private.py cover every part.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Awaitable, Callable, Iterator
from functools import partial
from typing import Any

import viser
import websockets.asyncio.server as websocket_server
from viser import _messages as messages
from websockets.asyncio.server import ServerConnection

from flexviz.base.errors import InputError
from flexviz.outlets.app.input_rules import rule_of, upload_refusal

log = logging.getLogger("flexviz.outlets.app")
TRIED_WITH = "1.1.1"
UNWANTED = (
    messages.ShareUrlRequest,  # opens a public tunnel
    messages.ShareUrlDisconnect,
    messages.GuiFormSubmitMessage,
    messages.GuiFormDirtyMessage,
)
UPLOAD_PATIENCE = 60.0  # [s] without a part, after which an upload is given up


# -- the connection ---------------------------------------------------------------------------------------


@contextlib.contextmanager
def served_by(serve: Callable[..., Any]) -> Iterator[None]:
    """Let a ViserServer that is started in this context call `serve(original, …)` for websockets' `serve`."""
    module: Any = websocket_server
    original = module.serve
    module.serve = partial(serve, original)
    try:
        yield
    finally:
        module.serve = original


Handler = Callable[[ServerConnection], Awaitable[None]]


# -- messages ------------------------------------------------------------------------------------------------


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


def put_together(handle: Any, **values: Any) -> None:
    """Set properties of a control in one message.

    Each property that is set alone travels in a message of its own, and of many messages, also of an atomic
    group, a page may draw the first 128 before the others arrive: then uPlot fails, for instance, if a chart
    has its new series and still its old data.
    """
    sent = {}
    for name, value in values.items():
        sent[name] = handle._cast_value_recursive(handle._prop_hints[name], value, name)
        setattr(handle._impl.props, name, sent[name])
    interface = handle._impl.gui_api._websock_interface
    interface.queue_message(messages.GuiUpdateMessage(handle._impl.uuid, sent))


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


def _send_back(server: viser.ViserServer, client_id: Any, handle: Any) -> None:
    """Restore the value in the browser that sent an invalid one."""
    client = server.get_clients().get(client_id)
    if client is not None and not handle._impl.is_button:
        update = messages.GuiUpdateMessage(id_of(handle), {"value": handle.value})
        client._websock_connection.queue_message(update)


# -- controls on the page -----------------------------------------------------------------------------------

DARK = '[data-mantine-color-scheme="dark"]'  # the element that has the dark theme
DOCK = "[data-dock-root]"
CANVAS = f"{DOCK} > div:first-child"
BACKGROUND = f'div[style*="background-color"]:has(> div > {DOCK})'  # of the canvas
SHADOW = f'{DOCK} > div[style*="box-shadow"]'  # of a dock, at the width that viser gives it
LEFT, RIGHT = (f'[data-dock-region="{side}"]:not(:has([data-dock-rail-root]))' for side in ("left", "right"))
DOCK_HANDLES = ("[data-dock-region-collapse]", "[data-dock-region-resize]")
TAB = "[data-dock-tab]"
SCROLLED = "[data-dock-group] .mantine-ScrollArea-content"  # what a panel contains
WINDOW = "[data-floating-window]"
NOTIFICATIONS = ".mantine-Notifications-root"
PLOT = ".uplot-container"
NUMBER_BOX, SLIDER_VALUE = ".mantine-NumberInput-root", ".mantine-Slider-label"  # at a slider
# its colours do not contrast enough; the page's own ones, for style sheets
THEME = """
:root { --fv-text: var(--mantine-color-text); --fv-dimmed: var(--mantine-color-dimmed);
  --fv-body: var(--mantine-color-body); }
html:root[data-mantine-color-scheme] { --mantine-color-dimmed: #5b636b; --mantine-color-gray-filled: #5b636b;
  --mantine-color-gray-filled-hover: #495057; --mantine-color-blue-filled: #0067b8;
  --mantine-color-blue-filled-hover: #00589c; --mantine-color-blue-outline: #0067b8;
  --mantine-color-blue-light-color: #0067b8; --mantine-color-red-filled: #c92a2a;
  --mantine-color-red-filled-hover: #b02525; --mantine-color-orange-filled: #a84300;
  --mantine-color-orange-filled-hover: #8f3900; }
html:root[data-mantine-color-scheme="dark"] { --mantine-color-dimmed: #a6adb4;
  --mantine-color-blue-outline: #6cb8f5; --mantine-color-blue-light-color: #6cb8f5; }
[data-mantine-color-scheme="dark"] [style*="; color: var(--mantine-primary-color-filled)"] {
  color: #6cb8f5 !important; }
.mantine-Slider-markLabel { color: var(--mantine-color-dimmed); }
"""


def id_of(handle: Any) -> str:
    """The id of a control in messages and on the page."""
    return handle._impl.uuid


def button(uuid: str) -> str:
    """CSS selector of a button."""
    return f'button[id="{uuid}"]'


def button_box(uuid: str) -> str:
    """CSS selector of what holds a button."""
    return f"div:has(> {button(uuid)})"


def control(uuid: str) -> str:
    """CSS selector of the row of a control with a label; its first child holds the label."""
    return f"div.mantine-Flex-root:has({_label(uuid)})"


def control_box(uuid: str) -> str:
    """CSS selector of what holds this row."""
    return f"div:has(> div.mantine-Flex-root {_label(uuid)})"


def _label(uuid: str) -> str:
    return f'> div > p > label[for="{uuid}"]'


def window(panel: str) -> str:
    """CSS selector of the floating window with this panel."""
    return f'{WINDOW}:has({TAB}[title="{panel}"])'


def dock_width(dock: str, width: str) -> str:
    """CSS rules that give `LEFT` or `RIGHT`, and what is in it, this width."""
    inside = f"{dock} > div:nth-child(2) > div {{ width: 100% !important; }}"
    return f"{dock} {{ width: {width} !important; }}\n{inside}\n"
