"""A recording in Rerun's own viewer in a real Chromium: 3D, states, residual, convergence, moving robots."""

from __future__ import annotations

import io
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexviz.analysis.identification import identify
from flexviz.base.resources import sessions_dir
from flexviz.content.charts import COLOURS, rgb
from flexviz.data.measurements import GroupTable, read_set, write_set
from flexviz.model.simulation import Run
from flexviz.outlets.recording import LiveRecording, record_set
from flexviz.outlets.recording.viewers import web_viewer
from flexviz.robot.robot import Robot

pytestmark = pytest.mark.browser

WIDTH, HEIGHT = 1100, 760
PATIENCE = 180.0  # [s] software rendering on a busy machine is slow

# parts of the window (left, top, right, bottom) as the blueprint lays them out
SCENE = (0.0, 0.12, 0.4, 0.58)
STATES = (0.41, 0.1, 1.0, 0.48)
RESIDUAL = (0.41, 0.57, 1.0, 0.72)
CONVERGENCE = (0.41, 0.76, 1.0, 0.86)
STAGES = (0.41, 0.92, 1.0, 0.97)
LANE = "#3790c3"  # of the first stage: Rerun lightens the first series' colour
UR5 = "example-robot-data:ur5"


def of_hue(picture: bytes, part: tuple[float, float, float, float], colour: str, near: float = 60.0) -> Any:
    """Which pixels of a part of the picture have the hue of `colour`, however bright: (H, W) booleans."""
    from PIL import Image

    pixels = np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"), dtype=float)
    height, width = pixels.shape[:2]
    left, top, right, bottom = part
    area = pixels[int(top * height) : int(bottom * height), int(left * width) : int(right * width)]
    wanted = np.array(rgb(colour), dtype=float)
    length = np.linalg.norm(area, axis=-1)
    saturated = area.max(axis=-1) - area.min(axis=-1) > near
    return saturated & (area @ wanted > 0.975 * np.maximum(length, 1.0) * np.linalg.norm(wanted))


@contextmanager
def viewer(file: Path, chromium: Any, asked: list[str]) -> Iterator[Any]:
    """A page with the recording; `asked` gets the addresses that it asks for."""
    with web_viewer([file], 0) as address:
        page = chromium.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        page.set_default_timeout(1000 * PATIENCE)
        page.on("request", lambda request: asked.append(request.url))
        page.route(
            "**/*", lambda route: route.continue_() if "//127.0.0.1:" in route.request.url else route.abort()
        )
        page.goto(address)
        yield page
        page.close()


def missing_after_patience(look: Callable[[], list[Any]], page: Any) -> list[Any]:
    """What `look` still misses once it misses nothing, or when patience ends."""
    end = time.monotonic() + PATIENCE
    while (missing := look()) and time.monotonic() < end:
        page.wait_for_timeout(2000)
    return missing


def still(page: Any, shot: Callable[[Any, str], bytes], name: str) -> list[str]:
    """The robots of a playing recording whose pixels have not changed since the first look."""
    robots = {"measured": COLOURS.measured, "identified": COLOURS.model}
    first: dict[str, Any] = {}

    def look() -> list[str]:
        seen = shot(page, name)
        places = {robot: of_hue(seen, SCENE, colour) for robot, colour in robots.items()}
        for robot, place in places.items():
            if place.mean() > 2e-3:
                first.setdefault(robot, place)
        changed = {robot: np.mean(place != places[robot]) for robot, place in first.items()}
        return [robot for robot in robots if changed.get(robot, 0.0) < 2e-3]

    return missing_after_patience(look, page)


@pytest.mark.slow
def test_recording_shows_everything(tmp_path: Path, chromium: Any, shot: Callable[[Any, str], bytes]) -> None:
    """Everything is seen, both robots move, and nothing outside this machine is asked for."""
    demo = read_set(sessions_dir() / "planar-2r-demo")
    demo = replace(demo, groups=demo.groups[:1])
    record_set(demo, identify(demo), tmp_path / "demo.rrd", samples=400)
    wanted = [
        (part, colour) for part in (SCENE, STATES, RESIDUAL) for colour in (COLOURS.measured, COLOURS.model)
    ]
    wanted += [(CONVERGENCE, COLOURS.measured), (STAGES, LANE)]
    asked: list[str] = []
    with viewer(tmp_path / "demo.rrd", chromium, asked) as page:
        base = page.url.partition("/?")[0]

        def look() -> list[Any]:
            seen = shot(page, "recording")
            return [(part, colour) for part, colour in wanted if of_hue(seen, part, colour).mean() < 5e-4]

        assert not missing_after_patience(look, page)
        assert not still(page, shot, "recording")
    assert asked and not [url for url in asked if not url.startswith((base, "blob:", "data:"))]


@pytest.mark.slow
def test_a_robot_with_meshes_moves(tmp_path: Path, chromium: Any, shot: Callable[[Any, str], bytes]) -> None:
    """A UR5, both robots swinging at their shoulders."""
    robot = Robot.load(UR5)
    time_ = np.arange(0.0, 20.0, 0.01)
    theta = np.zeros((len(time_), robot.n))
    theta[:, 1] = -1.0 + 0.8 * np.sin(time_)
    swing = GroupTable("swing", "t1", "p1", time_, theta, theta)
    write_set(tmp_path / "set", robot=UR5, joints=robot.joints, groups=[swing], payloads={"p1": ()})
    with LiveRecording(read_set(tmp_path / "set"), tmp_path / "ur5.rrd", samples=400) as recording:
        zero = np.zeros_like(theta)
        run = Run(time_, theta, zero, theta, zero, zero, zero, theta, 0.0)
        recording.replayed("swing", run)
    with viewer(tmp_path / "ur5.rrd", chromium, []) as page:
        assert not still(page, shot, "recording-ur5")
