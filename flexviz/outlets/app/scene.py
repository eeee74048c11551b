"""The 3D scene: measured robot (solid), simulated robots (ghosts), trails, payloads, arcs and labels."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import viser
from scipy.spatial.transform import Rotation

from flexviz.content.charts import COLOURS, rgb
from flexviz.content.scene import RobotShape, SceneLayout, arc_arrow, joint_axes, payload_place
from flexviz.content.wording import number
from flexviz.robot.robot import PayloadBody, Robot

GHOST_OPACITY, COLOURED_OPACITY = 0.45, 0.85
FLOOR = (128, 134, 142)  # reads on white and on dark
PAYLOAD_DENSITY = 1000.0  # [kg/m³]
ARC_WIDTH = 4.0  # [pixels]
LABEL_WIDTH = 26  # characters: two labels are beside each other on a narrow canvas
DEFLECTION_ARC = 0.75  # radius, relative to that of the torque's arc

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
        self._payload: list[list[Any]] = []
        self._loads: list[tuple[str, np.ndarray, Any]] = []  # link, place in its frame, label
        self._moved: dict[int, tuple[str, Any]] = {}  # joint -> reference link and what moves with it
        names = [joint.replace("/", "_") for joint in robot.joints]
        base = robot.link_poses(np.zeros(robot.n))
        for body in shape.bodies:
            label = "base" if body.joint is None else names[body.joint]
            mesh = server.scene.add_mesh_simple(
                f"/{name}/{label}", body.vertices, body.faces, color=colour, opacity=opacity,
                flat_shading=True, side="double", receive_shadow=False,
            )  # fmt: skip
            if body.joint is None:
                mesh.wxyz, mesh.position = _placed(base[body.link])
            else:
                _on_click(mesh, body.joint, on_click)
                self._moved[body.joint] = body.link, mesh
            self._bodies.append(mesh)
        self._axes = joint_axes(robot, shape)
        for joint, axis in enumerate(self._axes):
            if axis is not None and joint not in self._moved:  # without a body
                frame = server.scene.add_frame(f"/{name}/{names[joint]}", show_axes=False)
                self._moved[joint] = axis.link, frame
        self._arcs: dict[tuple[str, int], Any] = {}
        self._opacity = opacity
        self._trail: Any = None
        self._marked: Any = None

    def place(self, offset: np.ndarray) -> None:
        """Move to `offset` (3,) [m]."""
        self._frame.position = offset

    def pose(self, q: np.ndarray) -> None:
        """Take the joint positions q (n,) [rad]."""
        poses = self._robot.link_poses(q)
        moved = np.reshape([poses[link] for link, _ in self._moved.values()], (-1, 4, 4))
        places = zip(*_placed(moved), strict=True)
        for (_, handle), (wxyz, position) in zip(self._moved.values(), places, strict=True):
            handle.wxyz, handle.position = wxyz, position
        for link, at, label in self._loads:
            label.position = poses[link][:3, :3] @ at + poses[link][:3, 3]

    def colour(self, colours: Sequence[Colour] | None) -> None:
        """Set the colour of each joint's body, the base is grey; None: the robot's own colour."""
        for body, handle in zip(self._shape.bodies, self._bodies, strict=True):
            if colours is None:
                handle.color, handle.opacity = self._colour, self._opacity
            else:
                handle.color = COLOURS.body if body.joint is None else colours[body.joint]
                handle.opacity = self._opacity and COLOURED_OPACITY

    def carry(self, payload: Sequence[PayloadBody], named: bool) -> None:
        """Show the payload's bodies as balls of their mass, `named` with a label."""
        while self._payload:
            for part in self._payload.pop():
                part.remove()
        neutral = self._robot.link_poses(np.zeros(self._robot.n))
        self._loads = []
        for count, load in enumerate(payload):
            carried = payload_place(self._robot, self._shape, load, neutral)
            if carried is None:
                continue
            index, at = carried
            radius = (3.0 * load.mass / (4.0 * np.pi * PAYLOAD_DENSITY)) ** (1 / 3)
            ball = self._server.scene.add_icosphere(
                f"{self._bodies[index].name}/payload{count}", radius=min(radius, 0.15 * self._shape.reach),
                color=self._colour, opacity=self._opacity, position=at, subdivisions=2, receive_shadow=False,
            )  # fmt: skip
            self._payload.append([ball])
            if named:
                text = f"payload {number(load.mass, 2)} kg"
                label = self._server.scene.add_label(
                    f"/{self.name}/payload{count}", text, anchor="bottom-left", font_screen_scale=0.85
                )
                self._payload[-1].append(label)
                self._loads.append((self._shape.bodies[index].link, at, label))

    def arcs(self, kind: str, shares: np.ndarray | None, known: np.ndarray | None = None) -> None:
        """Draw the arcs "torque" or "deflection" around the posed joints: shares (n,) of half a turn.

        Those that are not `known` (n,) are hatched; None: all are.
        """
        if shares is None:
            for key in [key for key in self._arcs if key[0] == kind]:
                self._arcs.pop(key).remove()
            return
        outer = kind == "torque"
        for joint, axis in enumerate(self._axes):
            if axis is None:
                continue
            radius = axis.radius if outer else DEFLECTION_ARC * axis.radius
            whole = known is None or bool(known[joint])
            points, key = arc_arrow(axis, float(shares[joint]), radius, whole), (kind, joint)
            if key not in self._arcs:
                colour = rgb(COLOURS.torque if outer else COLOURS.deflection)
                name = f"{self._moved[joint][1].name}/{kind}"
                self._arcs[key] = self._lines(name, points, colour, ARC_WIDTH)
            else:
                self._arcs[key].points = points

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
            self._marked = self._lines(f"/{self.name}/marked", pieces, rgb(COLOURS.playhead), 5.0)

    def trail(self, positions: Sequence[np.ndarray]) -> None:
        """Draw the path of the arm's tip over M joint positions (n,) [rad]."""
        segments = self.path(positions)
        if self._trail is None:
            self._trail = self._lines(f"/{self.name}/trail", segments, self._trail_colour, 1.5)
        else:
            self._trail.points = segments

    def _lines(self, name: str, points: np.ndarray, colour: Colour, thickness: float) -> Any:
        """Line segments (K, 2, 3) [m], of this thickness [pixels]."""
        return self._server.scene.add_line_segments(
            name, points, colors=colour, thickness=thickness, thickness_units="screen"
        )

    def remove(self) -> None:
        self._frame.remove()


class Scene:
    """The robots of a measurement set on their stage: measured, identified, and another model beside them."""

    def __init__(
        self, server: viser.ViserServer, robot: Robot, shape: RobotShape, stage: SceneLayout, on_click: Click
    ) -> None:
        self._server, self._stage = server, stage
        self._labels: dict[str, Any] = {}
        size = 10.0 * max(stage.size, stage.width)
        middle = (float(stage.centre[0]), float(stage.centre[1]))
        self._grid = server.scene.add_grid(
            "/floor", width=size, height=size, cell_size=size / 40, section_size=size / 10, plane="xy",
            cell_color=FLOOR, section_color=FLOOR, plane_color=FLOOR, plane_opacity=0.16, shadow_opacity=0.5,
            fade_distance=0.5 * size, fade_strength=0.8, fade_from="origin", position=(*middle, stage.floor),
        )  # fmt: skip
        self._light = server.scene.add_light_spot(  # so faint that it only casts the shadows on the floor
            "/light", position=(*middle, stage.floor + 0.7 * size), angle=0.6, decay=0.0, intensity=0.02,
            direction=(0.0, 0.0, -1.0), cast_shadow=True,
        )  # fmt: skip

        def nodes(name: str, colour: str, ghost: bool = True) -> RobotNodes:
            own = rgb(colour) if ghost else COLOURS.body
            opacity = GHOST_OPACITY if ghost else None
            return RobotNodes(server, name, robot, shape, on_click, own, rgb(colour), opacity)

        self.measured = nodes("measured", COLOURS.measured, ghost=False)
        self.identified = nodes("identified", COLOURS.model)
        self.beside: RobotNodes | None = None
        self._add = lambda: nodes("beside", COLOURS.beside)

    @property
    def robots(self) -> list[RobotNodes]:
        """From left to right."""
        return [self.measured, self.identified, *([self.beside] if self.beside else [])]

    def place(self, layout: str, count: int) -> None:
        """Place `count` robots, 2 or 3, side by side or overlaid."""
        if count == 3 and self.beside is None:
            self.beside = self._add()
        elif count == 2 and self.beside is not None:
            self.beside.remove()
            self.beside = None
        self._layout = layout
        for robot, offset in zip(self.robots, self._stage.offsets(layout, count), strict=True):
            robot.place(offset)

    def labels(self, texts: Sequence[str]) -> None:
        """A label under every robot."""
        places = self._stage.label_places(self._layout, len(texts))
        names = [robot.name for robot in self.robots]
        for name in [name for name in self._labels if name not in names]:
            self._labels.pop(name).remove()
        for name, text, at in zip(names, texts, places, strict=True):
            if name not in self._labels:
                self._labels[name] = self._server.scene.add_label(
                    f"/labels/{name}", text, anchor="top-center", font_screen_scale=0.95
                )
            lines = (line for part in text.split("\n") for line in textwrap.wrap(part, LABEL_WIDTH))
            self._labels[name].text = "\n".join(lines)
            self._labels[name].position = at

    def mark(self, positions: Sequence[np.ndarray], chosen: np.ndarray) -> None:
        """Highlight the measured robot's path over positions (M of (n,)), only where `chosen` (M,)."""
        self.measured.mark(self.measured.path(positions)[chosen[:-1] & chosen[1:]])

    def pose(
        self,
        positions: Sequence[np.ndarray],
        arcs: tuple[np.ndarray | None, np.ndarray | None],
        determined: np.ndarray | None = None,
    ) -> None:
        """Set all robots' joint positions (n,) [rad] and the measured one's arcs in one update.

        `arcs`: torque and deflection as shares (n,) of half a turn; None for none. `determined`: whether each
        joint's deflection is (n,); None: all are.
        """
        with self._server.atomic():
            for robot, q in zip(self.robots, positions, strict=True):
                robot.pose(q)
            for kind, shares, known in zip(("torque", "deflection"), arcs, (None, determined), strict=True):
                self.measured.arcs(kind, shares, known)

    def shadows(self, on: bool) -> None:
        self._light.visible = on

    def remove(self) -> None:
        for part in (*self.robots, self._grid, self._light, *self._labels.values()):
            part.remove()


def _placed(poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Quaternions (…, 4) and positions (…, 3) of poses (…, 4, 4)."""
    return Rotation.from_matrix(poses[..., :3, :3]).as_quat(scalar_first=True), poses[..., :3, 3]


def _on_click(mesh: Any, joint: int, on_click: Click) -> None:
    @mesh.on_click
    async def _(_: Any) -> None:
        on_click(joint)
