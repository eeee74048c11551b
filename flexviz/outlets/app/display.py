"""The 3D display: motion of the robots, colours, labels, trails and highlighted instants."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import viser

from flexviz.content.scene import SIDE_BY_SIDE, scene_labels, scene_layout
from flexviz.outlets.app.cameras import Cameras
from flexviz.outlets.app.events import Event, EventQueue
from flexviz.outlets.app.legend_panel import colours_of, model_names
from flexviz.outlets.app.page import Page
from flexviz.outlets.app.page_script import SCREEN_LABEL
from flexviz.outlets.app.playback import Playback
from flexviz.outlets.app.scene import Scene
from flexviz.outlets.app.state import Changed
from flexviz.outlets.app.store import Store
from flexviz.outlets.app.style import hidden

TRAIL_POINTS = 160
MARKED_POINTS = 300  # resolution of the highlighted path

Positions = tuple[np.ndarray, ...]  # (n,) of the measured robot and of those beside it [rad]


class Display:
    """Draws the robots from the store; `scene` holds those of the open set."""

    scene: Scene

    def __init__(self, store: Store, page: Page, queue: EventQueue) -> None:
        self._store, self._server, self._queue = store, page.server, queue
        server = page.server
        self._cameras = cameras = Cameras(server)
        page.style(hidden, page.client_text(SCREEN_LABEL, cameras.reported, each=True, used=False))
        self.watched = cameras.watched  # whether a page is shown
        self.playback = Playback(store.clock, lambda: self.watched())
        self._placed: tuple[str, tuple[str, int], int] | None = None  # layout, camera, robots
        store.subscribe(Changed.OPENED, self._build)
        store.subscribe(Changed.GROUP, self._carry)
        store.subscribe(
            Changed.OPENED | Changed.GROUP | Changed.RESULT | Changed.DERIVED | Changed.DIAGNOSIS
            | Changed.VIEW,
            self._draw,
        )  # fmt: skip
        store.subscribe(Changed.HIGHLIGHT, self._mark)
        store.subscribe(Changed.CLOSED, self.playback.close)

        @server.on_client_connect
        async def _(client: viser.ClientHandle) -> None:
            queue.call(cameras.joined, client)

            @client.camera.on_update
            async def _(camera: viser.CameraHandle) -> None:
                number = camera.client.client_id
                queue.put(Event(("heard", number), cameras.heard, number))

        @server.on_client_disconnect
        async def _(client: viser.ClientHandle) -> None:
            queue.call(cameras.gone, client)

    def _clicked(self, joint: int) -> None:
        self._queue.put(Event(self, lambda _: self._store.select(joint=joint)))

    def _build(self) -> None:
        robot, shape = self._store.measurements.robot, self._store.opened.shape
        self._stage = scene_layout(robot, shape, self._store.motion.theta)
        self.playback.draw = None
        with self.playback.lock:
            if hasattr(self, "scene"):
                self.scene.remove()
            self.scene = Scene(self._server, robot, shape, self._stage, self._clicked)
        self._placed = None

    def _place(self) -> None:
        """Place the robots and aim the cameras, if their number, the layout or the view has changed."""
        view, robots = self._store.view, 2 if self._store.beside is None else 3
        if (view.layout, view.camera, robots) == self._placed:
            return
        self._placed = (view.layout, view.camera, robots)
        with self.playback.lock:
            self.playback.draw = None
            self.scene.place(view.layout, robots)
            self._cameras.show(self._stage, view.layout, view.camera[0], robots)
        self._carry()

    def _carry(self) -> None:
        with self.playback.lock:
            for nodes in self.scene.robots:
                nodes.carry(self._store.group.bodies, named=nodes is self.scene.measured)

    def _colour(self) -> None:
        """Colour links by the error of the model: on the measured robot, or on models side by side."""
        store, scene = self._store, self.scene
        own = colours_of(store, store.errors)
        shown, beside = None if own is None else own.colours, store.beside
        if beside is None or scene.beside is None:
            scene.measured.colour(shown)
            scene.identified.colour(None)
            return
        apart = store.view.layout == SIDE_BY_SIDE
        other = colours_of(store, beside[0].step)
        scene.measured.colour(None if apart else shown)
        scene.identified.colour(shown if apart else None)
        scene.beside.colour(other.colours if apart and other is not None else None)

    def _poses(self) -> Callable[[float], Positions]:
        """The positions of the robots over time [s], as they are drawn."""
        store, view, deflection = self._store, self._store.view, self._store.deflection
        motion, beside = store.motion, store.beside

        def poses(time: float) -> Positions:
            both = motion.pose(time, deflection, view.error, view.link_side)
            if beside is None:
                return both
            return *both, beside[2].pose(time, deflection, view.error, view.link_side)[1]

        return poses

    def _draw(self) -> None:
        scene, motion, view = self.scene, self._store.motion, self._store.view
        self._place()
        self._colour()
        scene.shadows(view.shadows)
        poses = self._poses()

        def draw(time: float) -> None:
            arcs = motion.arcs(time) if view.arcs else (None, None)
            scene.pose(poses(time), arcs, motion.determined)

        scene.labels(self._labels())
        drawn = [poses(float(time)) for time in self._instants(TRAIL_POINTS)]
        for robot, positions in zip(scene.robots, zip(*drawn, strict=True), strict=True):
            robot.trail(positions)
        self.playback.draw = draw

    def _labels(self) -> tuple[str, ...]:
        store, view, why = self._store, self._store.view, self._why_no_model()
        names, simulated = model_names(store), store.measurements.simulated
        rest = (view.error, why, simulated, view.link_side)
        labels = scene_labels(store.motion, store.deflection, *rest, names[0])
        if store.beside is None:
            return labels
        rest = (view.error, f"{names[1]}, being simulated", simulated, view.link_side)
        return *labels, scene_labels(store.beside[2], store.deflection, *rest, names[1])[1]

    def _instants(self, count: int) -> np.ndarray:
        """About `count` instants (M,) [s] of the motion."""
        time = self._store.motion.time
        return time[:: max(len(time) // count, 1)]

    def _why_no_model(self) -> str:
        if self._store.analysis.identification is None:
            return "not identified yet"
        failed = self._store.group.name in self._store.derived.failed
        return "simulation failed" if failed else "being simulated"

    def _mark(self) -> None:
        """Highlight the selected instants on the measured robot's path."""
        highlight = self._store.highlight
        if highlight is None or not len(highlight.time):
            self.scene.measured.mark(None)
            return
        poses, every = self._poses(), self._instants(MARKED_POINTS)
        nearest = np.clip(np.searchsorted(highlight.time, every), 0, len(highlight.time) - 1)
        self.scene.mark([poses(float(time))[0] for time in every], highlight.marked[nearest])
