"""The whole application without a browser, in a folder that tests may fill, and how tests use it."""

from __future__ import annotations

import asyncio
import re
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flexviz.outlets.app.application import Application
from flexviz.outlets.app.input_rules import rule_of
from flexviz.outlets.app.server import start_server
from flexviz.outlets.app.sets import open_set

BROWSER = 7  # the number of a browser that is not there
PATIENCE = 300.0  # [s] for anything; a test that waits so long has failed


@contextmanager
def running(root: Path, measurement_set: Path) -> Iterator[Application]:
    """The application on a set, started in `root`."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(root)
        server = start_server("127.0.0.1", 0)
        application = Application(server, open_set(measurement_set))
        application.display.watched = lambda: True  # as if a page were shown
        yield application
        application.close()
        server.stop()


def reopen(app: Application, measurement_set: Path) -> None:
    """Show this set from its beginning."""
    app.store.open(open_set(measurement_set))


def control(app: Application, label: str, index: int = 0) -> Any:
    """The control with this label; `index` counts those that share it."""
    handles = app.page.gui._gui_input_handle_from_uuid.values()
    found = [handle for handle in handles if getattr(handle, "label", None) == label]
    assert len(found) > index, f"{len(found)} controls are called {label!r}"
    return found[index]


def off(app: Application, label: str) -> bool:
    """Whether the control with this label cannot be used."""
    return control(app, label).disabled


def shown(app: Application, mark: str = "") -> str:
    """The HTML elements of the page that are visible, of those that contain the `mark`."""
    containers = app.page.gui._container_handle_from_uuid.values()
    handles: list[Any] = [handle for one in containers for handle in one._children.values()]  # type: ignore[attr-defined]
    found = [one.content for one in handles if isinstance(getattr(one, "content", None), str) and one.visible]
    return "\n".join(text for text in found if mark in text and not text.startswith("<style"))


def use(app: Application, label: str, value: Any = True, *, index: int = 0) -> None:
    """Use a control as a browser does, and let the loop act."""
    send(app, control(app, label, index), value)


def send(app: Application, handle: Any, value: Any = True) -> None:
    """What a browser sends for this control: checked, then told to its callbacks, then acted on."""
    value = rule_of(handle)(value)
    if not hasattr(handle, "options") and handle._impl.is_button:
        value = True
    handle._impl.value = value
    for callback in handle._impl.update_cb:
        finish(callback(SimpleNamespace(client_id=BROWSER, target=handle)))
    act(app)


def finish(call: Any) -> None:
    """Run a callback to its end, in a thread: this one may have an event loop of its own, as Playwright's."""
    with ThreadPoolExecutor(1) as pool:
        pool.submit(asyncio.run, call).result()


def upload(app: Application, name: str, content: bytes) -> None:
    """Upload a file."""
    app.queue.call(app.dock.steps[0].another._uploaded, SimpleNamespace(name=name, content=content))  # type: ignore[attr-defined]
    act(app)


def command(app: Application, label: str) -> None:
    """Give a command of the palette; it acts a moment later."""
    handles = app.page.gui._command_handle_from_uuid.values()
    (handle,) = [handle for handle in handles if handle.label == label]
    event: Any = SimpleNamespace(client_id=BROWSER)
    for callback in handle._impl.trigger_cb:
        finish(callback(event))
    act(app)


def act(app: Application) -> None:
    """Let the loop act on all that waits."""
    while len(app.queue):
        app.once(0.0)
    app.once(0.0)


def until(app: Application, condition: Callable[[], bool]) -> None:
    """Let the loop run until the condition holds."""
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, f"waited in vain; status: {status(app)}"
        app.once(0.05)


def settle(app: Application) -> None:
    """Let the loop run until every command has acted, or has been left to a control."""
    until(app, lambda: not app.page.commands._waiting)


def wait(app: Application) -> None:
    """Let the loop run until nothing is under way that the user waits for."""
    until(app, lambda: not app.store.running)


def status(app: Application) -> str:
    """The status line (HTML), without the marks of its numbers."""
    return re.sub(r"</?span[^>]*>", "", app.dock._status.content)


def chart(app: Application, column: str, key: str) -> tuple[np.ndarray, ...]:
    """The data of a chart in a tab of plots."""
    where = app.plots.residuals.charts if column == "residuals" else getattr(app.plots, f"_{column}")
    return where._charts[key]._handle.data
