"""Rerun's viewer on this machine: its own window, or its web page served offline.

Rerun's page loads fonts and sends statistics. Here one HTTP server on the loopback address serves it, and the
recordings, without those links and with a content security policy that blocks all other addresses.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Iterator, Mapping, Sequence
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import quote, unquote, urlsplit

from flexviz.base.errors import FlexvizError, InputError

HOST = "127.0.0.1"
PORT = 9090
FILES = {
    "/": "text/html; charset=utf-8",
    "/re_viewer.js": "text/javascript",
    "/re_viewer_bg.wasm": "application/wasm",
    "/sw.js": "text/javascript",
}
POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' blob:; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; worker-src 'self' blob:; "
    "connect-src 'self' data: blob:; object-src 'none'; base-uri 'none'; form-action 'none'"
)
START_TIMEOUT = 60.0  # [s] for the viewer's own server to answer
NO_STATISTICS = {"CI": "1"}  # makes the viewer send none
EXTERNAL_LINK = re.compile(rb"<link\b[^>]*https?://[^>]*>", re.IGNORECASE)


def rerun_program() -> Path:
    """The viewer itself; the `rerun` script only starts it and leaves it running."""
    import rerun_cli

    program = Path(rerun_cli.__file__).parent / "rerun"
    if not program.is_file():
        raise FlexvizError(f"Rerun's viewer is missing ({program}): reinstall rerun-sdk")
    return program


def has_display() -> bool:
    """Whether a window can be opened here."""
    if sys.platform in ("darwin", "win32"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def show_in_window(recordings: Sequence[Path]) -> str:
    """Open the recordings in Rerun's window and wait until it is closed; returns the error, or ""."""
    command = [str(rerun_program()), *(str(file) for file in recordings), "--new", "--bind", HOST]
    viewer = subprocess.Popen(
        command, env=os.environ | NO_STATISTICS, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    try:
        _, output = viewer.communicate()
    except BaseException:
        viewer.terminate()
        viewer.wait()
        raise
    if viewer.returncode == 0:
        return ""
    lines = [line for line in output.splitlines() if line.strip()]
    return lines[-1] if lines else f"exit code {viewer.returncode}"


def free_port() -> int:
    """A port that is free now; another program may take it before it is used."""
    with socket.socket() as trial:
        trial.bind((HOST, 0))
        return trial.getsockname()[1]


def viewer_page() -> dict[str, bytes]:
    """The files of the viewer's page, fetched from its own server, which is then stopped.

    Rerun's server takes no port 0, so it may find its ports taken meanwhile: it is then tried with others.
    """
    end = time.monotonic() + START_TIMEOUT
    while time.monotonic() < end:
        with contextlib.suppress(OSError):  # it ended, or another program answers at that port
            content = _fetched_page(end)
            content["/"] = EXTERNAL_LINK.sub(b"", content["/"])
            return content
    raise FlexvizError("Rerun's web viewer does not start; see the output of `rerun --serve-web`")


def _fetched_page(end: float) -> dict[str, bytes]:
    """One attempt; OSError if the server ends, or answers something else."""
    port, data = free_port(), free_port()
    command = [str(rerun_program()), "--serve-web", "--bind", HOST, "--port", str(data)]
    server = subprocess.Popen(
        [*command, "--web-viewer-port", str(port)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        while not _answers(port):
            if server.poll() is not None or time.monotonic() > end:
                raise OSError("no answer")
            time.sleep(0.05)
        content = {}
        for path in FILES:
            with urllib.request.urlopen(f"http://{HOST}:{port}{path}", timeout=START_TIMEOUT) as answer:
                content[path] = answer.read()
        return content
    finally:
        server.terminate()
        server.wait()


def _answers(port: int) -> bool:
    with socket.socket() as trial:
        return trial.connect_ex((HOST, port)) == 0


@contextlib.contextmanager
def web_viewer(recordings: Sequence[Path], port: int | None = None) -> Iterator[str]:
    """Serve the viewer with these recordings; yields the page's address.

    Raises:
        InputError: the port is in use.
    """
    files = {f"/recordings/{number}/{file.name}": file for number, file in enumerate(recordings)}
    server = _server(port, files)
    try:
        server.page = viewer_page()
    except BaseException:
        server.server_close()
        raise
    thread = threading.Thread(target=server.serve_forever, name="flexviz-viewer", daemon=True)
    thread.start()
    base = f"http://{HOST}:{server.server_port}"
    query = "&".join("url=" + quote(base + quote(path), safe="") for path in files)
    try:
        yield f"{base}/?{query}&renderer=webgl"
    finally:
        server.shutdown()
        server.server_close()


def _server(port: int | None, files: Mapping[str, Path]) -> _Server:
    """The server on this port (0: any free one), or on the usual one or, if that is in use, any."""
    try:
        return _Server((HOST, PORT if port is None else port), files)
    except OSError as error:
        if port is not None:
            raise InputError(f"port {port} cannot be used ({error.strerror})") from None
        return _Server((HOST, 0), files)


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, address: tuple[str, int], files: Mapping[str, Path]):
        super().__init__(address, _Handler)
        self.page: Mapping[str, bytes] = {}
        self.files = files
        self.hosts = {f"{name}:{self.server_port}" for name in (HOST, "localhost")}


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: _Server

    def do_GET(self) -> None:
        path = unquote(urlsplit(self.path).path)
        if self.headers.get("Host") not in self.server.hosts:  # DNS rebinding
            self.send_error(403)
        elif path in self.server.page:
            content = self.server.page[path]
            self._head(FILES[path], len(content))
            self.wfile.write(content)
        elif path in self.server.files:
            file = self.server.files[path]
            with file.open("rb") as stream:
                self._head("application/octet-stream", file.stat().st_size)
                shutil.copyfileobj(stream, self.wfile)
        else:
            self.send_error(404)

    def _head(self, kind: str, length: int) -> None:
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(length))
        self.send_header("rerun-final-length", str(length))  # for the page's progress
        self.send_header("Content-Security-Policy", POLICY)
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Referrer-Policy", "no-referrer")
        self.send_header("Cache-Control", "no-store")
        self.end_headers()

    def log_message(self, format: str, *args: object) -> None:
        pass
