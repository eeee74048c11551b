"""The server's door: a websocket client that sends what no page would."""

from __future__ import annotations

import http.client
import logging
import time
from collections.abc import Callable, Iterator
from typing import Any

import msgpack
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

from flexviz.base.errors import InputError
from flexviz.outlets.app import network
from flexviz.outlets.app.access import is_loopback
from flexviz.outlets.app.events import EventQueue
from flexviz.outlets.app.network import RateLimit
from flexviz.outlets.app.page import Page
from flexviz.outlets.app.server import start_server

viser = pytest.importorskip("viser")

PROTOCOL = Subprotocol("viser-v1.1.1")


class Controls:
    """One of each kind, watched."""

    def __init__(self, server: Any) -> None:
        self.queue = EventQueue()
        page, gui = Page(server, self.queue), server.gui

        def nothing(value: Any) -> None:
            pass

        self.slider = page.watch(gui.add_slider("s", 0.0, 10.0, 0.1, 5.0), nothing)
        self.whole = page.watch(gui.add_slider("i", 0, 10, 1, 5), nothing)
        self.number = page.watch(gui.add_number("n", 1.0, min=0.5, max=2.0), nothing)
        self.choice = page.watch(gui.add_dropdown("d", ("a", "b"), initial_value="a"), nothing)
        self.box = page.watch(gui.add_checkbox("c", False), nothing)
        self.text = page.watch(gui.add_text("t", "x"), nothing)
        self.button = page.client_button("b", nothing)
        self.off = page.client_button("off", nothing, disabled=True)
        self.upload = page.upload("u", nothing)
        self.row = page.choose(gui.add_button_group("g", ("x", "y")), nothing)

    def name(self, uuid: Any) -> str:
        """What the control with this id is called here."""
        return next(
            name
            for name, handle in vars(self).items()
            if hasattr(handle, "_impl") and handle._impl.uuid == uuid
        )


@pytest.fixture(scope="module")
def server() -> Iterator[Any]:
    """Of this machine, but hardened as one that others can reach."""
    server = start_server("127.0.0.1", 0, "secret")
    yield server
    server.stop()


def connected(server: Any, **more: Any) -> ClientConnection:
    port = server.get_port()
    headers = {"Cookie": f"flexviz_{port}=secret"} | more
    return connect(
        f"ws://127.0.0.1:{port}", subprotocols=[PROTOCOL], max_size=None, additional_headers=headers
    )


@pytest.fixture(scope="module")
def controls(server: Any) -> Controls:
    return Controls(server)


@pytest.fixture
def client(server: Any) -> Iterator[Any]:
    with connected(server) as connection:
        connection.send(camera())
        yield connection


def packed(message: Any) -> bytes:
    data = msgpack.packb(message)
    assert data is not None
    return data


def camera() -> bytes:
    message = {
        "type": "ViewerCameraMessage", "wxyz": (1, 0, 0, 0), "position": (3, 3, 3), "fov": 1.0,
        "near": 0.1, "far": 100.0, "image_height": 600, "image_width": 800, "look_at": (0, 0, 0),
        "up_direction": (0, 0, 1),
    }  # fmt: skip
    return packed(message)


def update(handle: Any, value: Any, **more: Any) -> bytes:
    return packed(
        {"type": "GuiUpdateMessage", "uuid": handle._impl.uuid, "updates": {"value": value, **more}}
    )


def settle(queue: EventQueue, client: ClientConnection, controls: Controls) -> list[tuple[str, Any]]:
    """Everything that came through, once a last known-good message has come through as well."""
    client.send(update(controls.row, "x"))
    events = []
    deadline = time.monotonic() + 5.0
    while time.monotonic() < deadline:
        event = queue.take(0.05)
        if event is None:
            continue
        name = controls.name(event.source)
        if name == "row":
            return events
        events.append((name, None if name == "button" else event.value))
    raise AssertionError("the server does not answer any more")


def test_good_values_arrive(client: ClientConnection, controls: Controls) -> None:
    for handle, value in (
        (controls.slider, 7),
        (controls.whole, 3),
        (controls.number, 0.75),
        (controls.choice, "b"),
    ):
        client.send(update(handle, value))
    client.send(update(controls.box, True))
    client.send(update(controls.button, True))
    got = settle(controls.queue, client, controls)
    assert got == [
        ("slider", 7.0),
        ("whole", 3),
        ("number", 0.75),
        ("choice", "b"),
        ("box", True),
        ("button", None),
    ]


@pytest.mark.parametrize(
    "name, value",
    [
        ("slider", 99999), ("slider", float("nan")), ("slider", "7"), ("slider", [1, 2]), ("slider", None),
        ("slider", {"a": 1}), ("whole", 2.5), ("whole", -1), ("number", 1e9),
        ("choice", "../../etc/passwd"), ("choice", 1), ("box", "yes"), ("box", 1), ("text", "x" * 100_000),
        ("text", b"\xff"),
        ("button", "go"), ("off", True), ("row", "z"),
    ],
)  # fmt: skip
def test_bad_values_do_not(client: ClientConnection, controls: Controls, name: str, value: Any) -> None:
    handle = getattr(controls, name)
    before = handle.value
    client.send(update(handle, value))
    assert settle(controls.queue, client, controls) == []
    if name != "row":
        assert handle.value == before


@pytest.mark.parametrize(
    "attribute", ["update_cb", "removed", "gui_api", "props", "is_button", "sync_cb", "__class__"]
)
def test_nothing_but_a_value_can_be_set(client: ClientConnection, controls: Controls, attribute: str) -> None:
    before = getattr(controls.slider._impl, attribute)
    message = {"type": "GuiUpdateMessage", "uuid": controls.slider._impl.uuid, "updates": {attribute: "x"}}
    client.send(packed(message))
    client.send(update(controls.slider, 6.0, **{attribute: "x"}))
    assert settle(controls.queue, client, controls) == []
    assert getattr(controls.slider._impl, attribute) is before


def test_the_sender_of_a_bad_value_is_shown_the_true_one(
    client: ClientConnection, controls: Controls, server: Any
) -> None:
    deadline = time.monotonic() + 5.0
    while not server.get_clients() and time.monotonic() < deadline:
        time.sleep(0.02)
    while _receive(client, 0.3):  # what every page gets first
        pass
    client.send(update(controls.number, 1e9))
    uuid, payloads = controls.number._impl.uuid, []
    while data := _receive(client, 1.0):
        payloads.append(_decoded(data))
    sent = [m for p in payloads for m in p["messages"] if m.get("uuid") == uuid]
    assert sent and sent[-1]["updates"] == {"value": controls.number.value}


def _receive(client: ClientConnection, timeout: float) -> bytes | None:
    try:
        data = client.recv(timeout=timeout)
    except TimeoutError:
        return None
    assert isinstance(data, bytes)
    return data


def _decoded(data: bytes) -> Any:
    import zstandard

    size = int.from_bytes(data[8:16], "little")
    plain = zstandard.ZstdDecompressor().decompress(data[16 : 16 + size], int.from_bytes(data[:8], "little"))
    return msgpack.unpackb(plain, strict_map_key=False)


@pytest.mark.parametrize(
    "message",
    [
        {"type": "ShareUrlRequest"},
        {"type": "ShareUrlDisconnect"},
        {"type": "FileTransferStartUpload", "source_component_uuid": "u", "transfer_uuid": "t",
         "filename": "../../x", "mime_type": "text/plain", "part_count": 1, "size_bytes": 10},
        {"type": "FileTransferPart", "source_component_uuid": "u", "transfer_uuid": "t",
         "part_index": 0, "content": b"x"},
        {"type": "GuiFormDirtyMessage", "uuid": "u"},
        {"type": "GuiFormSubmitMessage", "uuid": "u"},
        {"type": "GuiUpdateMessage", "uuid": "no such control", "updates": {"value": 1}},
        {"type": "CommandTriggerMessage", "uuid": "no such command"},
    ],
    ids=lambda message: message["type"],
)  # fmt: skip
def test_unwanted_messages_do_nothing(
    client: ClientConnection,
    controls: Controls,
    server: Any,
    message: dict[str, Any],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def tunnel(*args: Any, **kwargs: Any) -> None:
        raise AssertionError("a public tunnel was asked for")

    monkeypatch.setattr("viser._viser.ViserTunnel", tunnel)
    client.send(packed(message))
    assert settle(controls.queue, client, controls) == []
    assert server._share_tunnel is None


def test_uploads_that_stop_do_not_block_others(
    client: ClientConnection, controls: Controls, server: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    states = server.gui._current_file_upload_states
    message = {
        "type": "FileTransferStartUpload", "source_component_uuid": controls.upload._impl.uuid,
        "filename": "a.csv", "mime_type": "text/csv", "part_count": 1, "size_bytes": 10,
    }  # fmt: skip
    while not server.get_clients():
        time.sleep(0.02)
    for number in range(6):
        client.send(packed(message | {"transfer_uuid": f"t{number}"}))
    settle(controls.queue, client, controls)
    assert list(states) == ["t0", "t1", "t2", "t3"]
    payloads = []
    while data := _receive(client, 0.5):
        payloads.append(_decoded(data))
    said = [m for p in payloads for m in p["messages"] if m.get("type") == "NotificationShowMessage"]
    assert "4 uploads run already" in str(said)
    monkeypatch.setattr("flexviz.outlets.app.viser_private.UPLOAD_PATIENCE", -1.0)
    client.send(packed(message | {"transfer_uuid": "last"}))
    settle(controls.queue, client, controls)
    assert list(states) == ["last"]


UPDATE = {"type": "GuiUpdateMessage", "uuid": "u"}
GARBAGE = {
    "empty": b"", "code": b"\xc1", "no msgpack": b"not msgpack", "nested": b"\x91" * 5000, "text": "text",
    "unknown": msgpack.packb({"type": "NoSuchMessage"}), "incomplete": msgpack.packb(UPDATE),
    "number": msgpack.packb(UPDATE | {"uuid": 5, "updates": {}}),
    "list": msgpack.packb(UPDATE | {"uuid": ["u"], "updates": {}}),
    "long": msgpack.packb(msgpack.unpackb(camera()) | {"position": "x" * 100_000}),
    "short": msgpack.packb(msgpack.unpackb(camera()) | {"position": [1.0, 2.0]}),
}  # fmt: skip


@pytest.mark.parametrize("garbage", GARBAGE.values(), ids=GARBAGE)
def test_garbage_ends_only_its_own_connection(
    server: Any, client: ClientConnection, controls: Controls, garbage: Any, caplog: Any
) -> None:
    with connected(server) as other:
        other.send(garbage)
        with pytest.raises(ConnectionClosed):
            [other.recv(timeout=5) for _ in range(1000)]
    assert settle(controls.queue, client, controls) == [] and len(caplog.text) < 1000


# -- who may connect -------------------------------------------------------------------------------------


def answer_for(port: int, path: str = "/", **headers: str) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=5)
    connection.putrequest("GET", path, skip_host="Host" in headers)
    for name, value in headers.items():
        connection.putheader(name, value)
    connection.endheaders()
    return connection.getresponse()


def status_for(port: int, **headers: str) -> int:
    return answer_for(port, **headers).status


def test_other_machines_need_the_token(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="expected a token"):
        start_server("0.0.0.0", 0)
    server = start_server("0.0.0.0", 0, "secret")
    try:
        port = server.get_port()
        for path in ("/", "/?token=", "/?token=wrong", "/?token=%ff", "/index.html"):
            assert answer_for(port, path).status == 403
        for cookie in ("flexviz=secret", f"flexviz_{port}=wrong", "=;=", "\xe9"):
            assert answer_for(port, Cookie=cookie).status == 403
        with pytest.raises(InvalidStatus):
            connect(f"ws://127.0.0.1:{port}", subprotocols=[PROTOCOL])
        first = answer_for(port, "/?token=secret")
        assert first.status == 303 and first.headers["Location"] == "/"
        cookie = first.headers["Set-Cookie"].partition(";")[0]
        assert "HttpOnly" in first.headers["Set-Cookie"] and "Strict" in first.headers["Set-Cookie"]
        assert answer_for(port, Cookie=cookie).status == 200
        assert answer_for(port, Cookie=cookie, Host="evil.example").status == 403
        url = f"ws://127.0.0.1:{port}"
        with connect(
            url, subprotocols=[PROTOCOL], max_size=None, additional_headers={"Cookie": cookie}
        ) as one:
            one.send(camera())
            assert one.recv(timeout=5)
    finally:
        server.stop()


@pytest.fixture(scope="module")
def plain() -> Iterator[int]:
    """The port of a server for this machine alone."""
    server = start_server("127.0.0.1", 0)
    yield server.get_port()
    server.stop()


def test_no_other_page_can_frame_this_one(plain: int) -> None:
    headers = answer_for(plain).headers
    assert headers["X-Frame-Options"] == "DENY" and headers["X-Content-Type-Options"] == "nosniff"
    assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]


def test_malformed_frames_do_not_fill_the_log(server: Any, caplog: pytest.LogCaptureFixture) -> None:
    for _ in range(60):
        with connected(server) as one:
            one.send(b"not msgpack")
            with pytest.raises(ConnectionClosed):
                while True:
                    one.recv(timeout=5)
    assert len(caplog.text.splitlines()) < 30 and "Traceback" not in caplog.text


def test_what_was_not_logged_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(network.time, "monotonic", lambda: now[0])
    limit = RateLimit()
    record = lambda: logging.LogRecord("x", logging.WARNING, "", 0, "no %s", ("value",), None)  # noqa: E731
    assert sum(limit.filter(record()) for _ in range(100)) == network.LOG_LINES
    now[0] = network.LOG_PERIOD
    last = record()
    assert limit.filter(last) and last.getMessage() == "no value (80 more were not logged)"


def test_pages_of_other_sites_are_refused(plain: int) -> None:
    port = plain
    assert status_for(port) == 200
    assert status_for(port, Host=f"localhost:{port}") == 200
    assert status_for(port, Host=f"evil.example:{port}") == 403
    assert status_for(port, Origin="http://evil.example") == 403
    assert status_for(port, Origin=f"http://127.0.0.1:{port}") == 200


@pytest.mark.parametrize(
    "headers", [{"Origin": "http://evil.example"}, {"Origin": "null"}, {"Host": "evil.example"}]
)
def test_websockets_of_other_sites_are_refused(plain: int, headers: dict[str, str]) -> None:
    with pytest.raises(InvalidStatus) as refused:
        connect(
            f"ws://127.0.0.1:{plain}",
            subprotocols=[PROTOCOL],
            additional_headers=headers,
        )
    assert refused.value.response.status_code in (400, 403)


def test_loopback_names() -> None:
    assert all(is_loopback(name) for name in ("localhost", "127.0.0.9", "[::1]", "::1"))
    assert not any(is_loopback(name) for name in ("0.0.0.0", "lab.example"))


def test_ports(server: Any) -> None:
    with pytest.raises(InputError, match="cannot listen"):
        start_server("127.0.0.1", server.get_port())
    with pytest.raises(InputError, match="65535"):
        start_server("127.0.0.1", 99999)
    with pytest.raises(InputError, match="cannot listen"):
        start_server("no.such.host.invalid", token="secret")


def test_binds_loopback_only(server: Any) -> None:
    sockets: Callable[[], str] = server.get_host
    assert sockets() == "127.0.0.1"
