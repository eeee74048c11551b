"""A recording in Rerun's own viewer in a real Chromium: 3D, states, residual, convergence show something."""

from __future__ import annotations

import io
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexviz.identification import identify
from flexviz.measurements import read_set
from flexviz.recording import record_set
from flexviz.resources import sessions_dir
from flexviz.view.colours import MEASURED, MODEL, rgb

pytestmark = pytest.mark.browser

WIDTH, HEIGHT = 1100, 760
PATIENCE = 180.0  # [s] software rendering on a busy machine is slow

# parts of the window (left, top, right, bottom) as the blueprint lays them out
SCENE = (0.0, 0.12, 0.4, 0.58)
STATES = (0.41, 0.1, 1.0, 0.5)
RESIDUAL = (0.41, 0.56, 1.0, 0.72)
CONVERGENCE = (0.41, 0.82, 1.0, 0.95)


@contextmanager
def viewer(file: Path) -> Iterator[str]:
    """The address of a local viewer that shows `file`."""
    rerun_cli = pytest.importorskip("rerun_cli")
    # the `rerun` beside Python is a wrapper: ending it would leave the server running
    program = Path(rerun_cli.__file__).parent / "rerun"
    data, page = free_port(), free_port()
    command = [str(program), str(file), "--serve-web", "--bind", "127.0.0.1"]
    command += ["--port", str(data), "--web-viewer-port", str(page)]
    server = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        for _ in range(200):
            with socket.socket() as trial:
                if trial.connect_ex(("127.0.0.1", page)) == 0:
                    break
            time.sleep(0.1)
        yield f"http://127.0.0.1:{page}/?url=rerun%2Bhttp://127.0.0.1:{data}/proxy&renderer=webgl"
    finally:
        server.terminate()
        server.wait(timeout=15)


def free_port() -> int:
    with socket.socket() as trial:
        trial.bind(("127.0.0.1", 0))
        return trial.getsockname()[1]


def share_of(
    picture: bytes, part: tuple[float, float, float, float], colour: str, near: float = 60.0
) -> float:
    """The share of a part of the picture whose colour has the hue of `colour`, however bright."""
    from PIL import Image

    pixels = np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"), dtype=float)
    height, width = pixels.shape[:2]
    left, top, right, bottom = part
    area = pixels[int(top * height) : int(bottom * height), int(left * width) : int(right * width)].reshape(
        -1, 3
    )
    wanted = np.array(rgb(colour), dtype=float)
    length = np.linalg.norm(area, axis=1)
    saturated = area.max(axis=1) - area.min(axis=1) > near
    alike = area @ wanted > 0.975 * np.maximum(length, 1.0) * np.linalg.norm(wanted)
    return float(np.mean(saturated & alike))


def test_recording_shows_everything(tmp_path: Path, chromium: Any, shot: Callable[[Any, str], bytes]) -> None:
    demo = read_set(sessions_dir() / "planar-2r-demo")
    result = identify(demo)
    record_set(replace(demo, groups=demo.groups[:1]), result, tmp_path / "demo.rrd", samples=400)
    wanted = [(part, colour) for part in (SCENE, STATES, RESIDUAL) for colour in (MEASURED, MODEL)]
    wanted += [(CONVERGENCE, MEASURED)]
    with viewer(tmp_path / "demo.rrd") as address:
        page = chromium.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        page.route(
            "**/*", lambda route: route.continue_() if "//127.0.0.1:" in route.request.url else route.abort()
        )
        page.goto(address)
        end = time.monotonic() + PATIENCE
        missing = wanted
        while missing and time.monotonic() < end:
            page.wait_for_timeout(2000)
            picture = shot(page, "recording")
            missing = [(part, colour) for part, colour in wanted if share_of(picture, part, colour) < 5e-4]
        page.close()
    assert not missing
