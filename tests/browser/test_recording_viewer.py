"""A recording in Rerun's own viewer in a real Chromium: 3D, states, residual, convergence show something."""

from __future__ import annotations

import io
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexviz.charts import COLOURS, rgb
from flexviz.identification import identify
from flexviz.measurements import read_set
from flexviz.recording import record_set
from flexviz.recording.viewers import free_port, web_viewer
from flexviz.resources import sessions_dir

pytestmark = pytest.mark.browser

WIDTH, HEIGHT = 1100, 760
PATIENCE = 180.0  # [s] software rendering on a busy machine is slow

# parts of the window (left, top, right, bottom) as the blueprint lays them out
SCENE = (0.0, 0.12, 0.4, 0.58)
STATES = (0.41, 0.1, 1.0, 0.48)
RESIDUAL = (0.41, 0.57, 1.0, 0.72)
CONVERGENCE = (0.41, 0.82, 1.0, 0.95)


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
    """3D, states, residual and convergence are seen, and nothing outside this machine is asked for."""
    demo = read_set(sessions_dir() / "planar-2r-demo")
    demo = replace(demo, groups=demo.groups[:1])
    record_set(demo, identify(demo), tmp_path / "demo.rrd", samples=400)
    wanted = [
        (part, colour) for part in (SCENE, STATES, RESIDUAL) for colour in (COLOURS.measured, COLOURS.model)
    ]
    wanted += [(CONVERGENCE, COLOURS.measured)]
    asked: list[str] = []
    with web_viewer([tmp_path / "demo.rrd"], free_port()) as address:
        page = chromium.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        page.set_default_timeout(1000 * PATIENCE)
        page.on("request", lambda request: asked.append(request.url))
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
    base = address.partition("/?")[0]
    assert asked and not [url for url in asked if not url.startswith((base, "blob:", "data:"))]
