"""Validation of all messages and values from a browser.

viser does not validate them. This uses viser's internal handler tables, so viser's version is pinned and
tests/test_app_input_checks.py covers every check.
"""

from __future__ import annotations

import contextlib
import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import viser
from viser import _messages as messages

from flexviz.app.uploads import LARGEST_UPLOAD
from flexviz.errors import InputError

log = logging.getLogger("flexviz.app")

Kind = Literal["number", "choice", "switch", "press", "text", "range", "none"]
LONGEST_TEXT = 2000
LARGEST_INTEGER = 2**63
UNWANTED = (
    messages.ShareUrlRequest,  # opens a public tunnel
    messages.ShareUrlDisconnect,
    messages.GuiFormSubmitMessage,
    messages.GuiFormDirtyMessage,
)
RUNNING_UPLOADS = 4  # at most, of all browsers
LONGEST_FILE_NAME = 400


# -- values ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class InputRule:
    """What a control accepts.

    Attributes:
        kind: "number", "choice" (one of `options`), "switch" (true or false), "press" (a button), "text",
            "range" (`length` increasing numbers), or "none" (nothing at all).
        low, high: limits of numbers.
        whole: whether only whole numbers are accepted.
        options: what may be chosen.
        length: how many numbers a range has.
        disabled: whether the control is greyed out.
    """

    kind: Kind
    low: float = -math.inf
    high: float = math.inf
    whole: bool = False
    options: Sequence[str] = ()
    length: int = 0
    disabled: bool = False


def check(rule: InputRule, value: Any) -> Any:
    """`value` converted to the control's type; raises InputError if it is invalid."""
    if rule.disabled:
        raise InputError("the control is disabled")
    if rule.kind == "number":
        return _number(rule, value)
    if rule.kind == "choice":
        if not isinstance(value, str) or value not in rule.options:
            raise InputError(f"{_shown(value)} is not one of the {len(rule.options)} options")
        return value
    if rule.kind == "switch":
        if not isinstance(value, bool):
            raise InputError(f"{_shown(value)} is not true or false")
        return value
    if rule.kind == "press":
        if value is not True:
            raise InputError(f"a button is pressed with true, not {_shown(value)}")
        return value
    if rule.kind == "text":
        if not isinstance(value, str) or len(value) > LONGEST_TEXT:
            raise InputError(f"not a text of at most {LONGEST_TEXT} characters")
        return value
    if rule.kind == "range":
        if not isinstance(value, list | tuple) or len(value) != rule.length:
            raise InputError(f"{_shown(value)} is not a list of {rule.length} numbers")
        numbers = tuple(_number(rule, item) for item in value)
        if list(numbers) != sorted(numbers):
            raise InputError(f"{_shown(value)} does not increase")
        return numbers
    raise InputError("this control takes no value")


def _number(rule: InputRule, value: Any) -> float | int:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{_shown(value)} is not a number")
    if isinstance(value, int) and abs(value) > LARGEST_INTEGER:
        raise InputError("the number is too large")
    if not math.isfinite(value):
        raise InputError(f"{_shown(value)} is not finite")
    slack = 1e-9 * max(abs(rule.low), abs(rule.high), 1.0) if math.isfinite(rule.low + rule.high) else 0.0
    if not rule.low - slack <= value <= rule.high + slack:
        raise InputError(f"{_shown(value)} is not between {rule.low:g} and {rule.high:g}")
    if rule.whole:
        if value != int(value):
            raise InputError(f"{_shown(value)} is not a whole number")
        return int(value)
    return min(max(float(value), rule.low), rule.high)


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "…"


# -- messages --------------------------------------------------------------------------------------------


def guard_messages(server: viser.ViserServer) -> None:
    """Drop unneeded messages, and check every value before it reaches a control."""
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
    """Accept uploads only for upload buttons, limited in number and size."""
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
            log.warning("dropped an upload from browser %s: not as announced", client_id)
            states.pop(message.transfer_uuid, None)
            return
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


def rule_of(handle: Any) -> InputRule:
    """The rule of a viser control; unknown kinds accept nothing."""
    disabled = bool(getattr(handle, "disabled", False))
    if isinstance(handle, viser.GuiSliderHandle | viser.GuiNumberHandle):
        low = float("-inf") if handle.min is None else float(handle.min)
        high = float("inf") if handle.max is None else float(handle.max)
        return InputRule("number", low, high, whole=isinstance(handle.value, int), disabled=disabled)
    if isinstance(handle, viser.GuiMultiSliderHandle):
        whole = all(isinstance(value, int) for value in handle.value)
        limits = float(handle.min), float(handle.max)
        return InputRule("range", *limits, whole=whole, length=len(handle.value), disabled=disabled)
    if isinstance(handle, viser.GuiDropdownHandle | viser.GuiButtonGroupHandle):
        return InputRule("choice", options=tuple(handle.options), disabled=disabled)
    if isinstance(handle, viser.GuiCheckboxHandle):
        return InputRule("switch", disabled=disabled)
    if isinstance(handle, viser.GuiButtonHandle):
        return InputRule("press", disabled=disabled)
    if isinstance(handle, viser.GuiTextHandle):
        return InputRule("text", disabled=disabled)
    return InputRule("none")


def _send_back(server: viser.ViserServer, client_id: Any, handle: Any) -> None:
    """Restore the value in the browser that sent an invalid one."""
    client = server.get_clients().get(client_id)
    if client is not None and not handle._impl.is_button:
        update = messages.GuiUpdateMessage(handle._impl.uuid, {"value": handle.value})
        client._websock_connection.queue_message(update)
