"""The page: controls whose changes go into the event queue, commands, tooltips and the style sheet.

A value that the program itself sets causes no event.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import viser

from flexviz.app.commands import Command, Commands
from flexviz.app.events import Event, EventQueue
from flexviz.app.style import CSS, in_row
from flexviz.app.tooltips import Tooltips


class Page:
    """Builds controls in the current folder, and binds them to actions of the loop."""

    def __init__(self, server: viser.ViserServer, queue: EventQueue) -> None:
        self.server, self._queue = server, queue
        self.gui = server.gui
        self.commands = Commands(server, queue)
        self.tooltips = Tooltips()
        self.rules = [CSS]

    def call(self, action: Callable[[Any], None], value: Any) -> None:
        """Let the loop call `action(value)`. Thread-safe."""
        self._queue.call(action, value)

    def watch(self, handle: Any, action: Callable[[Any], None] = lambda _: None) -> Any:
        """Call `action(value)` when a browser changes this control."""

        async def changed(event: Any) -> None:
            if event.client_id is not None:
                self._queue.put(Event(handle._impl.uuid, action, event.target.value, control=True))

        handle.on_update(changed)
        return handle

    def choose(self, handle: Any, action: Callable[[str], None]) -> Any:
        """Call `action(option)` for every press in a button group."""

        async def chosen(event: Any) -> None:
            if event.client_id is not None:
                self._queue.put(Event(handle._impl.uuid, action, event.target.value, control=True), each=True)

        handle.on_click(chosen)
        return handle

    def button(self, label: str, action: Callable[[], None], **look: Any) -> Any:
        """A button that calls `action()`."""
        return self.client_button(label, lambda _: action(), **look)

    def client_button(
        self, label: str, action: Callable[[int], None], color: Any = "gray", **look: Any
    ) -> Any:
        """A button that calls `action(client)` with the number of the browser."""
        handle = self.gui.add_button(label, color=color, **look)

        async def pressed(event: Any) -> None:
            if event.client_id is not None:
                self._queue.put(Event(handle._impl.uuid, action, event.client_id, control=True))

        handle.on_click(pressed)
        self.tooltips.add(handle)
        return handle

    def upload(self, label: str, action: Callable[[Any], None], **look: Any) -> Any:
        """An upload button; `action` gets every file (`name`, `content`)."""
        handle = self.gui.add_upload_button(label, color="gray", **look)

        async def uploaded(event: Any) -> None:
            self._queue.call(action, event.target.value)

        handle.on_upload(uploaded)
        return handle

    def command(
        self,
        label: str,
        action: Callable[[], None],
        hotkey: str | None = None,
        modifier: str | None = None,
        *,
        shared: bool = False,
    ) -> None:
        """Add a command to the palette; `shared` if controls also use its key."""
        self.commands.add(Command(label, lambda _: action(), hotkey, modifier, shared))

    def client_command(self, label: str, action: Callable[[int], None]) -> None:
        """Add a command that is called with the number of the browser."""
        self.commands.add(Command(label, action))

    def row(self, buttons: Sequence[Any], share: float | None = None) -> None:
        """Place buttons side by side; each takes `share` of the row (None: equal shares)."""
        uuids = [button._impl.uuid for button in buttons]
        self.tooltips.open_left(uuids[(len(uuids) + 1) // 2 :] if share is None else uuids)
        self.rules.append(in_row(*uuids, share=share))

    def style(self, rule: Callable[..., str], handle: Any, *more: Any) -> None:
        """Add a rule of `app.style` for this control."""
        self.rules.append(rule(handle._impl.uuid, *more))

    def set_dark(self, dark: bool) -> None:
        """Light or dark theme."""
        self.gui.configure_theme(dark_mode=dark, show_share_button=False, show_logo=False)

    def alert(self, reason: str) -> None:
        """Show a failure as a notification in every browser."""
        for client in self.server.get_clients().values():
            client.add_notification("That did not work", reason, color="red", auto_close_seconds=12)

    def send_file(self, client: int, name: str, content: bytes) -> None:
        """Send a file to a browser, if it is still connected."""
        handle = self.server.get_clients().get(client)
        if handle is not None:
            handle.send_file_download(name, content, save_immediately=True)


def off(handle: Any, why: str, hint: str = "") -> None:
    """Disable a control with the reason `why` as its hint; without a reason enable it with `hint`."""
    handle.disabled = bool(why)
    handle.hint = f"off: {why}" if why else hint


def dim(text: str) -> str:
    """A subdued sentence (HTML), or "" without text."""
    return f'<div class="fv fv-dim">{text}</div>' if text else ""


def warning(text: str) -> str:
    """A sentence that needs attention (HTML)."""
    return f'<div class="fv fv-warn">{text}</div>'
