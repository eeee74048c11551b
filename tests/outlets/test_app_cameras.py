"""Cameras: pointed at both robots after each change of a canvas, until the user moves them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest

from flexviz.base.errors import InputError
from flexviz.content.scene import Box, Screen, robot_shape, scene_layout
from flexviz.outlets.app import cameras
from flexviz.outlets.app.cameras import HIDDEN_AFTER, Cameras, read_report
from flexviz.robot.robot import Robot


@pytest.fixture(scope="module")
def stage() -> Any:
    robot = Robot.load("robots:planar_2r")
    theta = np.outer(np.sin(np.linspace(0, 6, 100)), [0.8, 0.5])
    return scene_layout(robot, robot_shape(robot), theta)


def browser(number: int) -> Any:
    camera = SimpleNamespace(position=np.zeros(3), look_at=np.ones(3), image_width=800, image_height=600)
    return SimpleNamespace(client_id=number, camera=camera, atomic=MagicMock())


def shown(stage: Any, *clients: Any) -> Cameras:
    server = MagicMock()
    server.get_clients.return_value = {client.client_id: client for client in clients}
    ours = Cameras(server)
    ours.show(stage, "Side by side", "Front", 2)
    for client in clients:
        ours.joined(client)
    return ours


def wanted(stage: Any, screen: Screen, view: str = "Front") -> np.ndarray:
    return stage.camera("Side by side", stage.direction(view), 2, screen)[0]


def test_every_browser_has_the_camera_of_its_own_canvas(stage: Any) -> None:
    one, two = browser(0), browser(7)
    ours = shown(stage, one, two)
    assert np.allclose(one.camera.position, wanted(stage, Screen(800, 600)))
    ours.reported((7, "a.1 400 900 0 0,700,400,900"))
    assert np.allclose(two.camera.position, wanted(stage, Screen(400, 900, (Box(0, 700, 400, 900),))))
    assert np.allclose(one.camera.position, wanted(stage, Screen(800, 600)))
    before = two.camera.position
    ours.reported((7, "a.2 0 0 0"))  # a column lies over it
    assert two.camera.position is before


def test_a_view_that_viser_has_overridden_is_set_again(stage: Any) -> None:
    one = browser(0)
    ours = shown(stage, one)
    ours.reported((0, "a.1 800 600 0"))
    one.camera.position = np.array([3.0, 3.0, 3.0])  # its initial camera, applied late
    ours.reported((0, "a.2 800 600 0"))
    assert np.allclose(one.camera.position, wanted(stage, Screen(800, 600)))


def test_a_camera_moved_by_hand_keeps_its_direction(stage: Any) -> None:
    one = browser(0)
    ours = shown(stage, one)
    one.camera.position = one.camera.look_at + np.array([3.0, 0.0, 1.0])
    ours.reported((0, "a.1 800 600 1"))
    ours.reported((0, "a.2 800 600 1 0,0,300,200"))  # a panel has grown
    assert np.allclose(one.camera.position - one.camera.look_at, [3.0, 0.0, 1.0])
    ours.reported((0, "a.3 500 600 1"))  # the window is smaller
    away = one.camera.position - one.camera.look_at
    assert np.allclose(away / np.linalg.norm(away), np.array([3.0, 0.0, 1.0]) / np.sqrt(10), atol=5e-3)
    assert np.linalg.norm(away) > np.sqrt(10) + 0.5
    ours.show(stage, "Side by side", "Above", 2)  # asked for by name
    assert np.allclose(one.camera.position, wanted(stage, Screen(500, 600), "Above"))


def test_a_page_is_hidden_when_it_tells_nothing_any_more(stage: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(cameras.time, "monotonic", lambda: now[0])
    one, two = browser(0), browser(1)
    ours = shown(stage, one, two)
    now[0] += HIDDEN_AFTER
    assert not ours.watched()
    ours.reported((1, "b.1 800 600 0"))
    assert ours.watched()
    ours.gone(two)
    assert not ours.watched()
    ours.heard(0)
    assert ours.watched()


@pytest.mark.parametrize(
    "text",
    [
        "",
        "a 1 2",
        "a 800 600 x",
        "a 800 nan 0",
        "a 800 inf 0",
        "a -1 600 0",
        "a 8e9 600 0",
        "a 800 600 -1",
        "a 800 600 0 1,2,3",
        "a 800 600 0 1,2,3,4,5",
        "a 800 600 0 1,2,3,1e9",
        "a 800 600 0 1,2,3,4 1,2,3,4 1,2,3,4 1,2,3,4 1,2,3,4",
    ],
)
def test_reports_are_checked(text: str) -> None:
    with pytest.raises(InputError, match="report of a canvas"):
        read_report(text)
