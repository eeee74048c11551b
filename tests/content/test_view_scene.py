"""Colours, shapes, stage and camera of the scene."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexviz.content.charts import palette as colours
from flexviz.content.rendering import panel
from flexviz.content.scene import FIELD_OF_VIEW, VIEWS, Box, Screen, robot_shape, scene_layout
from flexviz.content.scene.shape import MAX_FACES, thinned_mesh
from flexviz.content.scene.stage import LABEL_HEIGHT
from flexviz.content.topics import set_blocks
from flexviz.content.wording import escape
from flexviz.data.measurements import read_set
from flexviz.robot.robot import Robot
from tests.small_set import write_small_set


def test_colours() -> None:
    assert colours.cividis(0.0) == (0, 34, 78) and colours.cividis(9.9) == (254, 232, 56)
    assert colours.cividis(float("nan")) == colours.COLOURS.body
    assert colours.rgb("#0072B2") == (0, 114, 178) and colours.css((0, 114, 178)) == "#0072b2"
    assert escape("<a>") == "&lt;a&gt;"


# -- shapes ----------------------------------------------------------------------------------------------

BARE = """<robot name="bare"><link name="base"/><link name="l1"/><link name="l2"/>
<joint name="j1" type="revolute"><parent link="base"/><child link="l1"/><origin xyz="0 0 0.3"/>
<axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="9" velocity="9"/></joint>
<joint name="j2" type="revolute"><parent link="l1"/><child link="l2"/><origin xyz="0.5 0 0"/>
<axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="9" velocity="9"/></joint></robot>"""


def test_a_robot_without_shapes_is_drawn_as_capsules(tmp_path: Path) -> None:
    (tmp_path / "bare.urdf").write_text(BARE)
    shape = robot_shape(Robot.load("bare.urdf", base=tmp_path))
    assert [body.joint for body in shape.bodies] == [None, 0, 1]
    upper = shape.bodies[1].vertices
    assert upper[:, 0].min() < 0.0 and upper[:, 0].max() > 0.5  # from joint to joint
    assert shape.tip == "l2"


def test_a_link_whose_mesh_is_not_there_is_drawn_as_a_stick_and_that_is_said(tmp_path: Path) -> None:
    mesh = '<link name="l1"><visual><geometry><mesh filename="package://gone/arm.stl"/></geometry></visual>'
    (tmp_path / "arm.urdf").write_text(BARE.replace('<link name="l1"/>', mesh + "</link>"))
    shape = robot_shape(Robot.load("arm.urdf", base=tmp_path))
    assert {body.joint for body in shape.bodies} >= {0, 1} and len(shape.missing) == 1
    assert 'mesh "package://gone/arm.stl" not found' in shape.missing[0]
    measurements = read_set(write_small_set(tmp_path / "small"))
    assert "sticks" in panel(set_blocks(measurements, shape.missing)) and "sticks" not in panel(
        set_blocks(measurements)
    )
    assert "(and 1 other)" in panel(set_blocks(measurements, shape.missing * 2))


@pytest.mark.parametrize("source", ["robots:planar_2r", "example-robot-data:panda", "example-robot-data:ur5"])
def test_shapes_of_shipped_robots_are_light_and_move_with_their_joints(source: str) -> None:
    robot = Robot.load(source)
    shape = robot_shape(robot)
    assert {body.joint for body in shape.bodies} >= set(range(robot.n))
    assert sum(len(body.faces) for body in shape.bodies) < MAX_FACES * len(shape.bodies)
    for body in shape.bodies:
        assert body.faces.max() < len(body.vertices) and np.isfinite(body.vertices).all()
        assert robot.joint_of_link(body.link) == body.joint


def test_a_heavy_mesh_is_thinned() -> None:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=6)
    light = thinned_mesh(ball)
    assert len(light.faces) <= MAX_FACES and np.allclose(light.bounds, ball.bounds, atol=0.05)


def test_a_planar_motion_is_looked_at_squarely() -> None:
    robot = Robot.load("robots:planar_2r")
    theta = np.outer(np.sin(np.linspace(0, 6, 100)), [0.8, 0.5])
    placed = scene_layout(robot, robot_shape(robot), theta)
    axis = np.array([0.0, 1.0, 0.0])
    assert abs(placed.towards @ axis) > 0.9 and abs(placed.right @ axis) < 0.1
    left, right = placed.offsets("Side by side")
    assert np.linalg.norm(right - left) > placed.width
    assert np.array_equal(placed.offsets("Overlaid"), np.zeros((2, 3)))
    assert len(placed.offsets("Side by side", 3)) == 3
    panel = Box(0, 0, 300, 200)
    for view in VIEWS:  # the labels and the whole motion are in the picture, beside or under the panel
        towards = placed.direction(view)
        for screen in (Screen(520, 800, (panel,)), Screen(900, 500, (panel,)), Screen(240, 700)):
            camera, look = placed.camera("Side by side", towards, 2, screen)
            label = np.array(placed.label_places("Side by side"))
            points = np.concatenate([placed.points + base for base in (left, right)])
            x, y = on_screen(np.concatenate([points, label]), camera, look, screen)
            assert x.min() > 0 and y.min() > 0 and x.max() < screen.width and y.max() < screen.height
            assert not np.any((x < panel.right) & (y < panel.bottom) & bool(screen.covered))
            assert y[-2:].max() + LABEL_HEIGHT < screen.height
            tight = min(x.min(), y.min(), screen.width - x.max(), screen.height - LABEL_HEIGHT - y[-2:].max())
            assert tight < 0.2 * screen.width  # as large as it can be
            assert x[-1] - x[-2] > 0.2 * screen.width  # the measured robot is on the left
            assert view == "Oblique" or abs(y[-1] - y[-2]) < 2


def on_screen(points: Any, camera: Any, look: Any, screen: Screen) -> tuple[Any, Any]:
    """Where points (P, 3) are drawn: pixels from the left and from the top."""
    forward = (look - camera) / np.linalg.norm(look - camera)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    away = points - camera
    pixel = screen.height / 2 / np.tan(FIELD_OF_VIEW / 2) / (away @ forward)
    return (
        screen.width / 2 + pixel * (away @ right),
        screen.height / 2 - pixel * (away @ np.cross(right, forward)),
    )


@pytest.mark.parametrize("name", ["planar_2r", "ur5", "panda", "lying"])
def test_the_measured_robot_is_on_the_left_and_a_plane_is_seen_face_on(name: str, tmp_path: Path) -> None:
    if name == "lying":  # an arm in a horizontal plane
        links = "".join(f'<link name="l{number}"/>' for number in range(4))
        joints = "".join(
            f'<joint name="j{k}" type="{"fixed" if k == 2 else "revolute"}"><parent link="l{k}"/>'
            f'<child link="l{k + 1}"/><origin xyz="{0.4 * (k > 0)} 0 0"/><axis xyz="0 0 1"/>'
            '<limit lower="-3" upper="3" effort="9" velocity="9"/></joint>'
            for k in range(3)
        )
        (tmp_path / "lying.urdf").write_text(f'<robot name="lying">{links}{joints}</robot>')
        robot = Robot.load(tmp_path / "lying.urdf")
    else:
        robot = Robot.load("robots:planar_2r" if name == "planar_2r" else f"example-robot-data:{name}")
    theta = np.outer(np.sin(np.linspace(0, 6, 100)), np.linspace(0.9, 0.4, robot.n))
    placed = scene_layout(robot, robot_shape(robot), theta)
    screen = Screen(520, 800)
    camera, look = placed.camera("Side by side", placed.direction("Front"), 2, screen)
    bases = np.array(placed.offsets("Side by side"))
    x, y = on_screen(bases + placed.centre, camera, look, screen)
    assert x[0] < 0.4 * screen.width < 0.6 * screen.width < x[1] and abs(y[0] - y[1]) < 2
    if name == "lying":
        assert placed.towards[2] > 0.9
