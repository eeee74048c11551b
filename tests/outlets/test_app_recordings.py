"""Recordings of the app, while one works and at any time, and what is said where that fails."""

from __future__ import annotations

import asyncio
import re
import resource
import signal
import subprocess
import sys
from collections.abc import Iterator
from html import unescape
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import parse_qs, urlsplit
from urllib.request import urlopen

import pytest

from benchmarks.clients import CAMERA, Crowd, messages, packed
from flexviz.outlets.app.application import Application
from flexviz.outlets.app.recordings import model_label
from flexviz.outlets.app.steps.data import DataStep
from flexviz.outlets.app.steps.files import Files
from flexviz.outlets.app.workspace import output_dir
from flexviz.outlets.recording import check_recording
from tests.app_running import BROWSER, PATIENCE, control, finish, running, status, until, use, wait
from tests.small_set import write_small_set


@pytest.fixture(scope="module")
def app(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Application]:
    root = tmp_path_factory.mktemp("recordings")
    with running(root, write_small_set(root / "small")) as application:
        yield application


def files_of(app: Application) -> Files:
    return next(step for step in app.dock.steps if isinstance(step, DataStep)).files


def test_a_recording_grows_with_the_session(app: Application, monkeypatch: pytest.MonkeyPatch) -> None:
    files = files_of(app)
    use(app, "Run")
    wait(app)
    use(app, "Record", True)  # what is known by then is in it
    until(app, lambda: "Recording" in files._note.content and "MB so far" in files._note.content)
    file = next(output_dir().glob("small-*.rrd"))
    use(app, "Torque offset", True)
    use(app, "Run")
    wait(app)
    use(app, "Undo")
    use(app, "Record", False)
    until(app, lambda: "Recorded in ./sessions/small-" in files._note.content)
    checked = check_recording(file)
    entities = set(checked.entities)
    assert {"/results/1/about", "/results/2/about", "/log"} <= entities
    assert any(entity.startswith("/results/2/optimiser/") for entity in entities)
    assert app.store.session.recordings == (file,)

    browser = Browser(app, monkeypatch)
    use(app, "Download recording")
    assert browser.files == [(file.name, file.read_bytes())]  # the session has not changed since


def test_a_recording_of_the_session_at_any_time(app: Application, monkeypatch: pytest.MonkeyPatch) -> None:
    files, browser = files_of(app), Browser(app, monkeypatch)
    use(app, "Torque offset", control(app, "Torque offset").value is False)
    use(app, "Run")
    wait(app)
    use(app, "Download recording")
    until(app, lambda: len(browser.files) > 0)
    name, content = browser.files[0]
    assert (
        output_dir() / name
    ).read_bytes() == content and f"Recorded in ./sessions/{name}" in files._note.content
    entities = set(check_recording(output_dir() / name).entities)
    assert {"/results/1/about", "/results/2/about", "/log"} <= entities  # all results of the history

    use(app, "Open in Rerun")  # the session has not changed: the same file
    until(app, lambda: "Rerun shows" in status(app))
    assert f"{name} in Rerun</a>" in files._note.content and name in status(app)
    address = re.search(r"window\.open\(&quot;(http://127\.0\.0\.1:\d+/\S+?)&quot;", browser.elements[-1])
    assert address is not None
    (recording,) = parse_qs(urlsplit(unescape(address[1])).query)["url"]
    with urlopen(recording) as answer:
        assert answer.read() == content

    before = set(output_dir().glob("*.rrd"))
    use(app, "Undo")
    use(app, "Open in Rerun")
    until(app, lambda: len(set(output_dir().glob("*.rrd")) - before) == 1 and not app.store.running)
    with pytest.raises(OSError):  # the viewer shows the new one alone
        urlopen(recording)


class Browser:
    """A browser that keeps what it is sent: files (name, content), and elements that act on its page."""

    def __init__(self, app: Application, monkeypatch: pytest.MonkeyPatch) -> None:
        self.files: list[tuple[str, bytes]] = []
        self.elements: list[str] = []
        self.gui, self.camera = SimpleNamespace(add_html=self.add_html), SimpleNamespace(position=1.0)
        monkeypatch.setattr(app.page.server, "get_clients", lambda: {BROWSER: self})

    def send_file_download(self, name: str, content: bytes, **_: Any) -> None:
        self.files.append((name, content))

    def add_html(self, html: str) -> Any:
        self.elements.append(html)
        return SimpleNamespace(remove=lambda: None)

    def add_notification(self, *_: Any, **__: Any) -> None:
        pass


def test_models_have_names() -> None:
    assert model_label(()) == "present model"
    assert model_label(("coulomb_friction:joint2",)) == "with Coulomb friction on joint2"


def test_recordings_lie_in_the_folder_of_sessions(app: Application) -> None:
    assert all(file.parent == output_dir() for file in Path.cwd().rglob("*.rrd"))


async def recorded(address: str, told: list[str]) -> None:
    """Switch Record on, as a page does, and wait for what the page is told of it."""
    async with Crowd(address.replace("http", "ws")).page() as page:
        await page.send(packed(CAMERA))
        async for data in page:
            for message in messages(data) if isinstance(data, bytes) else ():
                if message["type"] == "GuiCheckboxMessage" and message["props"]["label"] == "Record":
                    switch = {"type": "GuiUpdateMessage", "uuid": message["uuid"], "updates": {"value": True}}
                    await page.send(packed(switch))
                if message["type"] == "NotificationShowMessage" and "rrd" in str(message):
                    told.append(str(message))
                    return


def test_a_full_disk_is_told_and_a_terminated_server_ends(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "flexviz", "serve", str(write_small_set(tmp_path / "small"))]
    server = subprocess.Popen(
        [*command, "--no-browser", "--port", "0"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        cwd=tmp_path, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000)),
    )  # fmt: skip
    told: list[str] = []
    try:
        assert server.stdout is not None and server.stderr is not None
        address = re.findall(r"http://\S+", server.stdout.readline())[0]
        finish(asyncio.wait_for(recorded(address, told), PATIENCE))
        server.send_signal(signal.SIGTERM)
        assert server.wait(60.0) == 130
        assert "Traceback" not in server.stderr.read()
    finally:
        server.kill()
    assert "the recording has stopped" in told[0] and "cannot be written (File too large)" in told[0]
