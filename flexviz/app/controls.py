"""Controls whose changes go into the event queue; what the program itself sets is no event."""

from __future__ import annotations

from typing import Any

from flexviz.app.events import EventQueue


def watch(handle: Any, queue: EventQueue, key: str) -> Any:
    """Put (key, value) into the queue whenever a browser changes this control."""

    async def changed(event: Any) -> None:
        if event.client_id is not None:
            queue.put(key, event.target.value)

    handle.on_update(changed)
    return handle


def press(handle: Any, queue: EventQueue, key: str) -> Any:
    """Put `key` into the queue when a browser presses this button."""

    async def pressed(event: Any) -> None:
        if event.client_id is not None:
            queue.put(key)

    handle.on_click(pressed)
    return handle


def press_of(handle: Any, queue: EventQueue, key: str) -> Any:
    """Put (key, browser) into the queue when a browser presses this button."""

    async def pressed(event: Any) -> None:
        if event.client_id is not None:
            queue.put(key, event.client_id)

    handle.on_click(pressed)
    return handle


def off(handle: Any, why: str, hint: str = "") -> None:
    """Grey a control for a reason, which its hint tells; without a reason it is on and has this hint."""
    handle.disabled = bool(why)
    handle.hint = f"off: {why}" if why else hint


def choose(handle: Any, queue: EventQueue, key: str) -> Any:
    """Put (key, option) into the queue for every press in a row of buttons."""

    async def chosen(event: Any) -> None:
        if event.client_id is not None:
            queue.put(key, event.target.value, each=True)

    handle.on_click(chosen)
    return handle


def command(
    server: Any,
    queue: EventQueue,
    key: str,
    label: str,
    hotkey: str | None = None,
    modifier: str | None = None,
) -> Any:
    """A command in the palette, perhaps with a key; it waits a moment in the queue (see `keys`)."""
    handle = server.gui.add_command(label, hotkey=hotkey, modifier=modifier)

    async def triggered(event: Any) -> None:
        queue.put("command", (key, event.client_id), each=True)

    handle.on_trigger(triggered)
    return handle
