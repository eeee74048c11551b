"""Many websocket clients at once: `python -m benchmarks.clients [--clients 200] [--seconds 30]`.

Of the clients six in ten are idle pages; one in twenty never reads what it is sent; the others send malformed
or hostile frames, or come and go. Two good pages measure how long a change of one takes to reach the other.
The exit code is 1 if the app stops answering, writes a traceback or does not end on SIGTERM.
"""

from __future__ import annotations

import asyncio
import itertools
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Coroutine
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import msgpack
import numpy as np
import psutil
import zstandard
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import WebSocketException
from websockets.typing import Subprotocol

from benchmarks.command import command

PROTOCOL = Subprotocol("viser-v1.1.1")
SHARES = {"idle": 0.6, "deaf": 0.05, "hostile": 0.2, "restless": 0.15}
PATIENCE = 30.0  # [s] for one change to be seen
OPENING = 300.0  # [s] for all pages to open
ENDING = 60.0  # [s] for the server to end after SIGTERM
PUBLIC = ("--public-host", "localhost")  # as to a network, with a token
LOG = 10  # lines of the server's log that are shown
VALUES = itertools.count(1)  # of a slider: each change has its own
CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": (1, 0, 0, 0), "position": (3, 3, 3), "fov": 1.0, "near": 0.1,
    "far": 100.0, "image_height": 600, "image_width": 800, "look_at": (0, 0, 0), "up_direction": (0, 0, 1),
}  # fmt: skip


def packed(message: Any) -> bytes:
    return msgpack.packb(message) or b""


@dataclass
class Crowd:
    """What the clients did."""

    url: str  # without the token
    token: str = ""
    uuids: list[str] = field(default_factory=list)  # of the page's controls
    done: Counter[str] = field(default_factory=Counter)

    def page(self) -> connect:
        cookie = {"Cookie": f"flexviz_{urlsplit(self.url).port}={self.token}"}
        options = {"max_size": None, "compression": None, "open_timeout": 60, "additional_headers": cookie}
        return connect(self.url, subprotocols=[PROTOCOL], **options)


# -- clients ---------------------------------------------------------------------------------------------


async def idle(crowd: Crowd, rng: random.Random) -> None:
    async with crowd.page() as one:
        await one.send(packed(CAMERA))
        crowd.done["idle pages"] += 1
        async for _ in one:
            pass


async def deaf(crowd: Crowd, rng: random.Random) -> None:
    async with crowd.page() as one:
        await one.send(packed(CAMERA))
        crowd.done["pages that never read"] += 1
        await asyncio.sleep(3600.0)


async def hostile(crowd: Crowd, rng: random.Random) -> None:
    while True:
        with suppress(WebSocketException, OSError):
            async with crowd.page() as one:
                while True:
                    await one.send(rng.choice(FRAMES)(crowd, rng))
                    crowd.done["hostile frames"] += 1
                    with suppress(TimeoutError):
                        await asyncio.wait_for(one.recv(), 0.05)
        await asyncio.sleep(1.0)


async def restless(crowd: Crowd, rng: random.Random) -> None:
    while True:
        with suppress(WebSocketException, OSError):
            async with crowd.page() as one:
                await one.send(packed(CAMERA))
                crowd.done["connections that come and go"] += 1
                await asyncio.sleep(rng.uniform(0.0, 4.0))
                if rng.random() < 0.5:
                    one.transport.abort()
        await asyncio.sleep(rng.uniform(0.0, 4.0))


def bad_value(crowd: Crowd, rng: random.Random) -> bytes:
    value = rng.choice([None, "x", 1e300, -1, [1], {"a": 1}, float("nan"), "../../etc/passwd", b"\xff"])
    return packed({"type": "GuiUpdateMessage", "uuid": rng.choice(crowd.uuids), "updates": {"value": value}})


def bad_upload(crowd: Crowd, rng: random.Random) -> bytes:
    upload = {"source_component_uuid": rng.choice(crowd.uuids), "transfer_uuid": str(rng.random())}
    about = {"filename": "../../x", "mime_type": "text/plain", "part_count": 1, "size_bytes": 10**9}
    return packed({"type": "FileTransferStartUpload", **upload, **about})


FRAMES: tuple[Callable[[Crowd, random.Random], bytes | str], ...] = (
    lambda crowd, rng: rng.randbytes(rng.randrange(200)),
    lambda crowd, rng: b"\x91" * 5000,
    lambda crowd, rng: "text",
    lambda crowd, rng: packed({"type": "NoSuchMessage"}),
    lambda crowd, rng: packed({"type": "ShareUrlRequest"}),
    lambda crowd, rng: packed({"type": "CommandTriggerMessage", "uuid": "none"}),
    lambda crowd, rng: packed({**CAMERA, "position": "x" * 100_000}),
    lambda crowd, rng: packed({"type": "GuiUpdateMessage", "uuid": [1], "updates": {"__class__": 1}}),
    bad_value, bad_value, bad_value, bad_upload,
)  # fmt: skip


# -- the two good pages ----------------------------------------------------------------------------------


def messages(data: bytes) -> list[dict[str, Any]]:
    """What one frame of the server holds."""
    size = int.from_bytes(data[8:16], "little")
    plain = zstandard.ZstdDecompressor().decompress(data[16 : 16 + size], int.from_bytes(data[:8], "little"))
    return msgpack.unpackb(plain, strict_map_key=False)["messages"]


class Page:
    """A good page that knows the controls it was sent."""

    def __init__(self, connection: ClientConnection) -> None:
        self.connection = connection
        self.controls: dict[str, dict[str, Any]] = {}
        self.seen: dict[tuple[str, Any], float] = {}  # control and value -> when it came
        self.task = asyncio.create_task(self._read())

    async def _read(self) -> None:
        async for data in self.connection:
            for message in messages(data) if isinstance(data, bytes) else ():
                uuid = message.get("uuid")
                if message["type"].startswith("Gui") and "props" in message:
                    self.controls[str(uuid)] = message
                if message["type"] == "GuiUpdateMessage" and "value" in message["updates"]:
                    value = message["updates"]["value"]
                    if isinstance(value, bool | int | float | str):
                        self.seen[str(uuid), value] = time.perf_counter()

    def control(self, kind: str, label: str) -> str:
        """The uuid of a control."""
        found = [
            u for u, m in self.controls.items() if m["type"] == kind and m["props"].get("label") == label
        ]
        if not found:
            labels = {m["props"].get("label") for m in self.controls.values() if m["type"] == kind}
            raise LookupError(f"no {kind} {label!r} among {labels}")
        return found[0]


async def changes(one: Page, other: Page, count: int, pause: float) -> list[float]:
    """Seconds until a change by one page is seen by the other, several times; infinite if never."""
    uuid = one.control("GuiSliderMessage", "Deflection ×")
    found = []
    for _ in range(count):
        value = next(VALUES)
        begin = time.perf_counter()
        update = {"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}}
        await one.connection.send(packed(update))
        while (uuid, value) not in other.seen and time.perf_counter() - begin < PATIENCE:
            await asyncio.sleep(0.001)
        found.append(other.seen.get((uuid, value), np.inf) - begin)
        await asyncio.sleep(pause)
    return found


def memory(process: int) -> float:
    """Resident memory of a process and its children [MB]."""
    family = [psutil.Process(process), *psutil.Process(process).children(recursive=True)]
    return sum(one.memory_info().rss for one in family) / 1e6


def said(title: str, seconds: list[float], process: int) -> None:
    ms = 1e3 * np.array(seconds)
    text = f"change seen after {np.median(ms):.0f} ms (median), {ms.max():.0f} ms at most"
    print(f"{title:28} {text}; {memory(process):.0f} MB", flush=True)


# -- the run ---------------------------------------------------------------------------------------------


async def crowded(url: str, process: int, clients: int, seconds: float) -> list[float]:
    """All times of changes, before, with and after the crowd."""
    address, _, token = url.partition("/?token=")
    crowd = Crowd(address.replace("http", "ws"), token)
    async with crowd.page() as first, crowd.page() as second:
        one, other = Page(first), Page(second)
        for page in (one, other):
            await page.connection.send(packed(CAMERA))
        await asyncio.sleep(5.0)
        crowd.uuids = list(one.controls)
        alone = await changes(one, other, 10, 0.2)
        said("two pages", alone, process)
        kinds: list[Callable[[Crowd, random.Random], Coroutine[Any, Any, None]]] = []
        for kind in (idle, deaf, hostile, restless):
            kinds += [kind] * round(SHARES[kind.__name__] * clients)
        tasks = [asyncio.create_task(kind(crowd, random.Random(n))) for n, kind in enumerate(kinds)]
        begin = time.perf_counter()
        while crowd.done["idle pages"] < kinds.count(idle) and time.perf_counter() - begin < OPENING:
            await asyncio.sleep(0.5)
        await asyncio.sleep(seconds / 2)
        among = await changes(one, other, max(int(seconds / 2), 10), 0.5)
        said(f"among {len(tasks)} clients", among, process)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        await asyncio.sleep(5.0)
        after = await changes(one, other, 10, 0.2)
        said("after they have left", after, process)
        for what, count in sorted(crowd.done.items()):
            print(f"{count:7} {what}")
        return [*alone, *among, *after]


@command
def main(*, clients: int = 200, seconds: float = 30.0) -> int:
    """Serve, crowd, end."""
    with tempfile.TemporaryDirectory() as folder, Path(folder, "log").open("w+") as log:
        server = subprocess.Popen(
            [sys.executable, "-P", "-m", "flexviz", "serve", "--no-browser", "--port", "0", *PUBLIC],
            stdout=subprocess.PIPE, stderr=log, text=True, cwd=folder,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        )  # fmt: skip
        try:
            assert server.stdout is not None
            url = server.stdout.readline().split(" at ")[1].split()[0]
            seen = asyncio.run(crowded(url, server.pid, clients, seconds))
            begin = time.perf_counter()
            server.send_signal(signal.SIGTERM)
            code = server.wait(ENDING)
            print(f"SIGTERM: ended after {time.perf_counter() - begin:.1f} s with exit code {code}")
        finally:
            server.kill()
        log.seek(0)
        lines = log.read().splitlines()
    tracebacks = sum(line.startswith("Traceback") for line in lines)
    print(f"log: {len(lines)} lines, {tracebacks} tracebacks")
    print("\n".join(line[:200] for line in (lines if tracebacks else lines[:LOG])))
    return int(bool(tracebacks) or not np.isfinite(seen).all())


if __name__ == "__main__":
    sys.exit(main())
