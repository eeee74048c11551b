"""Which Host and Origin headers reach the server."""

from __future__ import annotations

import socket
import subprocess
import sys

import pytest

from flexviz.base.errors import InputError
from flexviz.outlets.app import network
from flexviz.outlets.app.access import Access, is_loopback
from flexviz.outlets.app.network import NetworkAccess
from flexviz.outlets.app.server import start_server


@pytest.mark.parametrize(
    "bound_to, host, origin, expected",
    [
        ("127.0.0.1", "127.0.0.1:8080", None, True),
        ("127.0.0.1", "localhost:8080", "http://localhost:8080", True),
        ("127.0.0.1", "[::1]:8080", None, True),
        ("127.0.0.1", "localhost:8080", "http://127.0.0.1:8080", False),
        ("127.0.0.1", "localhost:8080", "http://localhost:9999", False),
        ("127.0.0.1", "robot.example:8080", None, False),
        ("127.0.0.1", None, None, False),
        ("127.0.0.1", "[:8080", None, False),
        ("127.0.0.1", "localhost:99999", None, False),
        ("0.0.0.0", "192.168.1.5:http", None, False),
        ("127.0.0.1", "192.168.1.5:8080", None, False),
        ("0.0.0.0", "192.168.1.5:8080", "http://192.168.1.5:8080", True),
        ("0.0.0.0", "192.168.1.5:8080", "http://evil.example", False),
        ("0.0.0.0", "lab-pc:8080", "http://lab-pc:8080", True),
        ("0.0.0.0", "lab-pc.local:8080", None, True),
        ("0.0.0.0", "lab-pc.example.org:8080", None, True),
        ("0.0.0.0", "evil.example:8080", "http://evil.example:8080", False),
        ("robot.example", "robot.example:8080", "http://robot.example:8080", True),
    ],
)
def test_who_is_admitted(
    bound_to: str, host: str | None, origin: str | None, expected: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(network.socket, "gethostname", lambda: "lab-pc")
    monkeypatch.setattr(network.socket, "getfqdn", lambda: "lab-pc.example.org")
    assert NetworkAccess(bound_to, "t").admits(host, origin) is expected
    if is_loopback(bound_to):
        assert Access().admits(host, origin) is expected


@pytest.mark.parametrize(
    "host, origin, expected",
    [
        ("robots.example.org", "https://robots.example.org", True),
        ("robots.example.org:8443", "https://robots.example.org:8443", True),
        ("Robots.Example.org", None, True),
        ("robots.example.org", "https://evil.example", False),
        ("other.example.org", "https://other.example.org", False),
    ],
)
def test_names_of_a_proxy_are_admitted(host: str, origin: str | None, expected: bool) -> None:
    assert NetworkAccess("127.0.0.1", "t", ("Robots.example.org",)).admits(host, origin) is expected


@pytest.mark.parametrize("name", ["", "a b", "https://robots.example.org", "robots.example.org:443", "-a"])
def test_what_is_no_name_of_a_host(name: str) -> None:
    with pytest.raises(InputError, match="is no name of a host"):
        start_server(names=(name,), token="t")


def test_a_proxy_needs_a_token() -> None:
    with pytest.raises(InputError, match="token"):
        start_server(names=("robots.example.org",))


def test_what_a_network_needs_is_not_loaded_for_this_machine_alone() -> None:
    program = """if True:
        import sys
        from flexviz.outlets.app.server import start_server
        for token in ("", "secret"):
            start_server(port=0, token=token).stop()
            app = "flexviz.outlets.app"
            print([m for m in (f"{app}.network", f"{app}.viser_frames") if m in sys.modules])
    """
    out = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    loaded = [line for line in out.splitlines() if line.startswith("[")]
    assert loaded == ["[]", "['flexviz.outlets.app.network', 'flexviz.outlets.app.viser_frames']"]


def test_connections_that_are_not_used_are_not_logged(caplog: pytest.LogCaptureFixture) -> None:
    server = start_server(port=0)
    for data in (b"", b"GET / HTTP/1.1\r\n", b"garbage\r\n\r\n"):
        with socket.create_connection(("127.0.0.1", server.get_port())) as unused:
            unused.sendall(data)
            unused.shutdown(socket.SHUT_WR)
            while unused.recv(1000):
                pass
    server.stop()
    assert not caplog.text
