"""The 3D scene: measured robot (solid), identified robot (ghost), their trails, payloads and labels."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import viser
import viser.transforms as tf

from flexviz.charts import COLOURS, rgb
from flexviz.robot import PayloadBody, Robot
from flexviz.scene import ARROW_RADIUS, FIELD_OF_VIEW, RobotShape, SceneLayout, torque_arrow, torque_axes

GHOST_OPACITY = 0.45
MOVED_CAMERA = 0.02  # share of the stage's width; users move the camera farther
HIDDEN_SHARE = 0.27  # of the canvas's height behind the playback panel, in windows of 800 to 1080 pixels
SAME_ASPECT = 0.02  # tolerance of width ÷ height; the number of pixels varies in slow browsers
SIZE_INTERVAL = 2.0  # [s] between requests of the canvas size
HIDDEN_AFTER = 8.0  # [s] without an answer: the page is hidden, its browser draws nothing
RESTING = 1.0  # [s] a camera has not moved: nobody is turning it

Colour = tuple[int, int, int]
Click = Callable[[int], None]  # gets the joint whose body was clicked


class RobotNodes:
    """One robot in the scene: a mesh for each body under `/<name>`."""

    def __init__(
        self, server: viser.ViserServer, name: str, robot: Robot, shape: RobotShape, on_click: Click,
        colour: Colour, trail: Colour, opacity: float | None = None,
    ) -> None:  # fmt: skip
        self.name = name
        self._server, self._robot, self._shape = server, robot, shape
        self._colour, self._trail_colour = colour, trail
        self._frame = server.scene.add_frame(f"/{name}", show_axes=False)
        self._bodies: list[Any] = []
        self._payload: list[Any] = []
        for body in shape.bodies:
            label = "base" if body.joint is None else robot.joints[body.joint].replace("/", "_")
            mesh = server.scene.add_mesh_simple(
                f"/{name}/{label}", body.vertices, body.faces, color=colour, opacity=opacity,
                flat_shading=True, side="double", cast_shadow=False, receive_shadow=False,
            )  # fmt: skip
            if body.joint is not None:
                _on_click(mesh, body.joint, on_click)
            self._bodies.append(mesh)
        self._axes = torque_axes(robot)
        self._arrows: list[Any] = []
        self._trail: Any = None
        self._marked: Any = None

    def place(self, offset: np.ndarray) -> None:
        """Move to `offset` (3,) [m]."""
        self._frame.position = offset

    def pose(self, q: np.ndarray) -> None:
        """Take the joint positions q (n,) [rad]."""
        poses = self._robot.link_poses(q)
        for body, handle in zip(self._shape.bodies, self._bodies, strict=True):
            pose = poses[body.link]
            handle.wxyz = tf.SO3.from_matrix(pose[:3, :3]).wxyz
            handle.position = pose[:3, 3]

    def colour(self, colours: Sequence[Colour]) -> None:
        """Set the colour of each joint's body; the base is grey."""
        for body, handle in zip(self._shape.bodies, self._bodies, strict=True):
            handle.color = COLOURS.body if body.joint is None else colours[body.joint]

    def carry(self, payload: Sequence[PayloadBody]) -> None:
        """Show the payload's bodies as balls of equal mass (2500 kg/m³)."""
        while self._payload:
            self._payload.pop().remove()
        neutral = self._robot.link_poses(np.zeros(self._robot.n))
        for number, load in enumerate(payload):
            joint = self._robot.joint_of_link(load.link)
            index = next((i for i, body in enumerate(self._shape.bodies) if body.joint == joint), None)
            if index is None or load.mass <= 0:
                continue
            relative = np.linalg.inv(neutral[self._shape.bodies[index].link]) @ neutral[load.link]
            at = relative[:3, :3] @ load.com + relative[:3, 3]
            radius = min((3.0 * load.mass / (4.0 * np.pi * 2500.0)) ** (1 / 3), 0.15 * self._shape.reach)
            ball = self._server.scene.add_icosphere(
                f"{self._bodies[index].name}/payload{number}", radius=radius, color=self._colour, position=at,
                subdivisions=2, cast_shadow=False, receive_shadow=False,
            )  # fmt: skip
            self._payload.append(ball)

    def torque(self, shares: np.ndarray | None, q: np.ndarray) -> None:
        """Draw torque arrows around the joints, shares (n,) of the largest torque, at q (n,) [rad]."""
        if shares is None:
            while self._arrows:
                self._arrows.pop().remove()
            return
        poses = self._robot.link_poses(q)
        there = [
            (axis, float(share)) for axis, share in zip(self._axes, shares, strict=True) if axis is not None
        ]
        radius = ARROW_RADIUS * self._shape.reach
        for index, (axis, share) in enumerate(there):
            points = torque_arrow(axis, share, radius)
            if index == len(self._arrows):
                self._arrows.append(self._lines(f"torque{index}", points, rgb(COLOURS.torque), 3.0))
            else:
                self._arrows[index].points = points
            self._arrows[index].wxyz = tf.SO3.from_matrix(poses[axis.link][:3, :3]).wxyz
            self._arrows[index].position = poses[axis.link][:3, 3]

    def path(self, positions: Sequence[np.ndarray]) -> np.ndarray:
        """Pieces (M − 1, 2, 3) [m] of the tip's path over M joint positions (n,) [rad]."""
        tips = [self._robot.link_poses(q)[self._shape.tip][:3, 3] for q in positions]
        path = np.array(tips, dtype=np.float32)
        return np.stack([path[:-1], path[1:]], axis=1)

    def mark(self, pieces: np.ndarray | None) -> None:
        """Highlight pieces (K, 2, 3) of the path."""
        if self._marked is not None:
            self._marked.remove()
            self._marked = None
        if pieces is not None and len(pieces):
            self._marked = self._lines("marked", pieces, rgb(COLOURS.playhead), 5.0)

    def trail(self, positions: Sequence[np.ndarray]) -> None:
        """Draw the path of the arm's tip over M joint positions (n,) [rad]."""
        segments = self.path(positions)
        if self._trail is None:
            self._trail = self._lines("trail", segments, self._trail_colour, 1.5)
        else:
            self._trail.points = segments

    def _lines(self, name: str, points: np.ndarray, colour: Colour, thickness: float) -> Any:
        """Line segments (K, 2, 3) [m], of this thickness [pixels]."""
        return self._server.scene.add_line_segments(
            f"/{self.name}/{name}", points, colors=colour, thickness=thickness, thickness_units="screen"
        )

    def remove(self) -> None:
        self._frame.remove()


class Scene:
    """Both robots of a measurement set on their stage."""

    def __init__(
        self, server: viser.ViserServer, robot: Robot, shape: RobotShape, stage: SceneLayout, on_click: Click
    ) -> None:
        self._server, self._stage = server, stage
        self._labels: dict[str, Any] = {}
        size = 6.0 * max(stage.size, stage.width)
        self._grid = server.scene.add_grid(
            "/floor", width=size, height=size, cell_size=size / 24, section_size=size / 6,
            position=(stage.centre[0], stage.centre[1], stage.floor), plane="xy",
        )  # fmt: skip
        blue, orange = rgb(COLOURS.measured), rgb(COLOURS.model)
        self.measured = RobotNodes(server, "measured", robot, shape, on_click, COLOURS.body, blue)
        self.identified = RobotNodes(
            server, "identified", robot, shape, on_click, orange, orange, GHOST_OPACITY
        )

    def place(self, layout: str) -> None:
        """Place the robots side by side or overlaid."""
        self._layout = layout
        for nodes, offset in zip((self.measured, self.identified), self._stage.offsets(layout), strict=True):
            nodes.place(offset)

    def labels(self, measured: str, identified: str) -> None:
        left, right = self._stage.label_places(self._layout)
        for name, text, at in (("measured", measured, left), ("identified", identified, right)):
            if name not in self._labels:
                self._labels[name] = self._server.scene.add_label(
                    f"/labels/{name}", text, anchor="top-center", font_screen_scale=0.95
                )
            self._labels[name].text = text
            self._labels[name].position = at

    def mark(self, positions: Sequence[np.ndarray], chosen: np.ndarray) -> None:
        """Highlight the measured robot's path over positions (M of (n,)), only where `chosen` (M,)."""
        self.measured.mark(self.measured.path(positions)[chosen[:-1] & chosen[1:]])

    def pose(self, measured: np.ndarray, identified: np.ndarray, torque: np.ndarray | None = None) -> None:
        """Set both robots' joint positions (n,) [rad] and the torque's shares (n,) in one update."""
        with self._server.atomic():
            self.measured.pose(measured)
            self.identified.pose(identified)
            self.measured.torque(torque, measured)

    def remove(self) -> None:
        for part in (self.measured, self.identified, self._grid, *self._labels.values()):
            part.remove()


class Cameras:
    """The camera of every browser, pointed at both robots until its user moves it."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._aimed: dict[int, float] = {}  # browser -> width ÷ height of its canvas
        self._views: dict[int, np.ndarray] = {}  # browser -> camera position
        self._answered: dict[int, float] = {}  # browser -> its last answer [s, monotonic]
        self._nudged = 1e-4  # relative camera motion that triggers an update
        self._asked = 0.0  # last request of the canvas size [s, monotonic]
        server.scene.set_up_direction("+z")
        server.scene.configure_default_lights(cast_shadow=False)

    def show(self, stage: SceneLayout, layout: str, view: str) -> None:
        """Point all cameras at the robots placed by `layout`, from the side that `view` names."""
        self._stage, self._layout, self._view = stage, layout, view
        self._begin, look = stage.camera(layout, view=view)
        self._server.initial_camera.position = tuple(self._begin)  # type: ignore[assignment]
        self._server.initial_camera.look_at = tuple(look)  # type: ignore[assignment]
        self._server.initial_camera.fov = FIELD_OF_VIEW
        for client in self._server.get_clients().values():
            self.aim(client)

    def aim(self, client: viser.ClientHandle) -> None:
        """Point one browser's camera at both robots, as close as its window allows."""
        self._aimed[client.client_id] = aspect = _aspect(client)
        self._answered.setdefault(client.client_id, time.monotonic())
        camera, look = self._stage.camera(self._layout, aspect, HIDDEN_SHARE, self._view)
        self._views[client.client_id] = camera
        with client.atomic():
            client.camera.position = camera
            client.camera.look_at = look

    def gone(self, client: viser.ClientHandle) -> None:
        self._aimed.pop(client.client_id, None)
        self._views.pop(client.client_id, None)
        self._answered.pop(client.client_id, None)

    def watched(self) -> bool:
        """Whether a page is shown: a hidden one does not answer, because its browser does not draw it."""
        return any(time.monotonic() - seen < HIDDEN_AFTER for seen in list(self._answered.values()))

    def resized(self, client: viser.ClientHandle) -> None:
        """Aim again if the canvas size has changed and the user has not moved the camera."""
        if client.client_id in self._aimed:
            self._answered[client.client_id] = time.monotonic()
        now = _aspect(client)
        changed = abs(self._aimed.get(client.client_id, now) / now - 1.0) >= SAME_ASPECT
        if changed and self._unmoved(client.client_id, client):
            self.aim(client)

    def _unmoved(self, number: int, client: viser.ClientHandle) -> bool:
        """Whether the user has not moved this browser's camera."""
        aimed = self._views.get(number)
        if aimed is None:
            return False
        # a browser may apply the initial camera after it was aimed
        ours = (aimed, self._begin)
        away = min(float(np.linalg.norm(client.camera.position - place)) for place in ours)
        return away < MOVED_CAMERA * self._stage.width

    def tick(self) -> None:
        """Ask every browser for its canvas size, which it sends only when its camera moves."""
        if time.monotonic() - self._asked < SIZE_INTERVAL:
            return
        self._asked = time.monotonic()
        for number, client in self._server.get_clients().items():
            if self._unmoved(number, client):
                self._nudged = -self._nudged
                client.camera.position = self._views[number] * (1.0 + self._nudged)
            elif time.monotonic() - self._answered.get(number, 0.0) > RESTING:
                self._nudged = -self._nudged
                client.camera.position = client.camera.position * (1.0 + self._nudged)


def _aspect(client: viser.ClientHandle) -> float:
    return max(client.camera.image_width, 1) / max(client.camera.image_height, 1)


def _on_click(mesh: Any, joint: int, on_click: Click) -> None:
    @mesh.on_click
    async def _(_: Any) -> None:
        on_click(joint)
