"""The page: controls whose changes go into the event queue, commands, tooltips and the style sheet.

A value that the program itself sets causes no event.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import viser

from flexviz.outlets.app.events import Event, EventQueue
from flexviz.outlets.app.layout import LAYOUT
from flexviz.outlets.app.page_script import COMING_LABEL, DROP_LABEL, new_tab, picture
from flexviz.outlets.app.style import CSS, Tooltips, hidden, hidden_button, in_row
from flexviz.outlets.app.viser_private import id_of

SETTLE = 0.06  # [s] delay of a command, in which a control may claim its key press
CTRL, SHIFT = "cmd/ctrl", "cmd/ctrl+shift"


@dataclass(frozen=True)
class Command:
    """An entry of the palette."""

    label: str  # unique
    action: Callable[[int], None]  # called with the number of the browser
    hotkey: Any = None
    modifier: Any = None
    shared: bool = False  # whether controls also use this key


@dataclass(frozen=True)
class _Request:
    command: Command
    client: int
    when: float = field(default_factory=time.monotonic)


class Commands:
    """The command palette and its keys. A key press used by the focused control triggers no command."""

    def __init__(self, server: viser.ViserServer, queue: EventQueue) -> None:
        self._server, self._queue = server, queue
        self.known: dict[str, Command] = {}  # by label
        self._waiting: list[_Request] = []
        self._touched = 0.0

    def add(self, command: Command) -> None:
        self.known[command.label] = command
        handle = self._server.gui.add_command(command.label, hotkey=command.hotkey, modifier=command.modifier)

        async def triggered(event: Any) -> None:
            self._queue.call(self._waiting.append, _Request(command, event.client_id))

        handle.on_trigger(triggered)

    def touched(self, when: float) -> None:
        """Record that a control was used at time `when` [s, monotonic]."""
        self._touched = when

    def due(self) -> list[Callable[[], None]]:
        """The actions of commands that are due."""
        now = time.monotonic()
        due = [request for request in self._waiting if now - request.when >= SETTLE]
        self._waiting[:] = [request for request in self._waiting if request not in due]
        return [
            partial(request.command.action, request.client)
            for request in due
            if not request.command.shared or abs(self._touched - request.when) > 2 * SETTLE
        ]


def ignore(_: Any) -> None:
    """Do nothing."""


class Page:
    """Builds controls in the current folder, and binds them to actions of the loop."""

    def __init__(self, server: viser.ViserServer, queue: EventQueue) -> None:
        self.server, self._queue = server, queue
        self.gui = server.gui
        self.call = queue.call  # lets the loop call `action(value)`; thread-safe
        self.commands = Commands(server, queue)
        self.tooltips = Tooltips()
        self.rules = [CSS, LAYOUT]
        self._sent: dict[int, Any] = {}  # browser -> the last element that acted there
        self._received: Callable[[Any], None] = ignore
        self._announced: Callable[[str], None] = ignore

    def add_drop_target(self) -> None:
        """Controls for the page's own script, which hands them files that are dropped anywhere."""
        coming = self.watch(self.gui.add_text(COMING_LABEL, ""), lambda text: self._announced(text))
        dropped = self.upload(DROP_LABEL, lambda file: self._received(file))
        self.style(hidden, coming)
        self.style(hidden_button, dropped)

    def receive(self, received: Callable[[Any], None], announced: Callable[[str], None]) -> None:
        """Let `received` get every dropped file, and `announced` first a text about all of them."""
        self._received, self._announced = received, announced

    def watch(self, handle: Any, action: Callable[[Any], None] = lambda _: None) -> Any:
        """Call `action(value)` when a browser changes this control."""
        handle.on_update(self._told(handle, lambda event: event.target.value, action))
        return handle

    def choose(self, handle: Any, action: Callable[[str], None]) -> Any:
        """Call `action(option)` for every press in a button group."""
        handle.on_click(self._told(handle, lambda event: event.target.value, action, each=True))
        return handle

    def _told(
        self,
        handle: Any,
        value: Callable[[Any], Any],
        action: Callable[[Any], None],
        each: bool = False,
        used: bool = True,
    ) -> Callable[[Any], Any]:
        """A callback of a control that queues `action(value(event))` if a browser used it."""

        async def told(event: Any) -> None:
            if event.client_id is not None:
                self._queue.put(Event(id_of(handle), action, value(event), control=used), each=each)

        return told

    def checkbox(
        self, label: str, on: bool = False, action: Callable[[bool], None] = lambda _: None, **look: Any
    ) -> Any:
        """A checkbox that calls `action(on)`."""
        return self.watch(self.gui.add_checkbox(label, on, **look), action)

    def dropdown(
        self, label: str, options: Sequence[str], action: Callable[[str], None] = lambda _: None, **look: Any
    ) -> Any:
        """A dropdown that calls `action(option)`; without `initial_value` it begins with the first option."""
        return self.watch(self.gui.add_dropdown(label, tuple(options), **look), action)

    def button(self, label: str, action: Callable[[], None], **look: Any) -> Any:
        """A button that calls `action()`."""
        return self.client_button(label, lambda _: action(), **look)

    def client_button(
        self, label: str, action: Callable[[int], None], color: Any = "gray", **look: Any
    ) -> Any:
        """A button that calls `action(client)` with the number of the browser."""
        handle = self.gui.add_button(label, color=color, **look)
        handle.on_click(self._told(handle, lambda event: event.client_id, action))
        self.tooltips.add(handle)
        return handle

    def client_text(
        self, label: str, action: Callable[[tuple[int, str]], None], each: bool = False, used: bool = True
    ) -> Any:
        """A text that calls `action((client, text))` with the browser's number; `each`: every time.

        `used`: a user has caused it, and it may have taken a key press.
        """
        handle = self.gui.add_text(label, "")
        told = self._told(handle, lambda event: (event.client_id, event.target.value), action, each, used)
        handle.on_update(told)
        return handle

    def upload(self, label: str, action: Callable[[Any], None], **look: Any) -> Any:
        """An upload button; `action` gets every file (`name`, `content`)."""
        handle = self.gui.add_upload_button(label, color="gray", **look)

        async def uploaded(event: Any) -> None:
            self._queue.call(action, event.target.value)

        handle.on_upload(uploaded)
        return handle

    def command(self, label: str, action: Callable[[], None], *key: str, shared: bool = False) -> None:
        """Add a command to the palette, with its hotkey and modifier if any; see `Command`."""
        self.commands.add(Command(label, lambda _: action(), *key, shared=shared))

    def client_command(self, label: str, action: Callable[[int], None]) -> None:
        """Add a command that is called with the number of the browser."""
        self.commands.add(Command(label, action))

    def row(self, buttons: Sequence[Any], share: float | None = None) -> None:
        """Place buttons side by side; each takes `share` of the row (None: equal shares)."""
        uuids = [id_of(button) for button in buttons]
        self.tooltips.open_left(uuids[(len(uuids) + 1) // 2 :] if share is None else uuids)
        self.rules.append(in_row(*uuids, share=share))

    def style(self, rule: Callable[..., str], handle: Any, *more: Any) -> None:
        """Add a rule of `app.style` for this control."""
        self.rules.append(rule(id_of(handle), *more))

    def set_dark(self, dark: bool) -> None:
        self.gui.configure_theme(dark_mode=dark, show_share_button=False, show_logo=False)

    def alert(self, reason: str) -> None:
        """Show a failure as a notification in every browser."""
        for client in self.server.get_clients().values():
            client.add_notification("That did not work", reason, color="red", auto_close_seconds=12)

    def send_picture(self, client: int, svg: str, title: str, file: str) -> None:
        """Let a browser draw an SVG and save it as PNG `file`."""
        self._send_element(client, picture(svg, title, file))

    def open_tab(self, client: int, address: str) -> None:
        """Let a browser open an address in a new tab; it may refuse."""
        self._send_element(client, new_tab(address))

    def _send_element(self, client: int, html: str) -> None:
        handle = self.server.get_clients().get(client)
        if handle is not None:
            if client in self._sent:
                self._sent[client].remove()
            self._sent[client] = handle.gui.add_html(html)

    def send_file(self, client: int, name: str, content: bytes) -> None:
        """Send a file to a browser, if it is still connected."""
        handle = self.server.get_clients().get(client)
        if handle is not None:
            handle.send_file_download(name, content, save_immediately=True)


def off(handle: Any, why: str, hint: str = "") -> None:
    """Disable a control with the reason `why` as its hint; without a reason enable it with `hint`."""
    put(handle, disabled=bool(why), hint=f"off: {why}" if why else hint)


def put(handle: Any, **values: Any) -> None:
    """Set properties of a control that are not so already; setting one costs viser 0.1 ms."""
    for name, value in values.items():
        if getattr(handle, name) != value:
            setattr(handle, name, value)


def dim(text: str) -> str:
    """A subdued sentence (HTML), or "" without text."""
    return f'<div class="fv fv-dim">{text}</div>' if text else ""


def warning(text: str) -> str:
    """A sentence that needs attention (HTML)."""
    return f'<div class="fv fv-warn">{text}</div>'
