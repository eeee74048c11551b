"""The 3D display: motion of both robots, colours, labels, trails and highlighted instants."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import viser

from flexviz.app.events import Event, EventQueue
from flexviz.app.playback import Playback
from flexviz.app.scene import Cameras, Scene
from flexviz.app.state import Changed
from flexviz.app.store import Store
from flexviz.charts import COLOURS
from flexviz.scene import scene_labels, scene_layout

TRAIL_POINTS = 160
MARKED_POINTS = 300  # resolution of the highlighted path

Positions = tuple[np.ndarray, np.ndarray]  # (n,) of the measured and the identified robot [rad]


class Display:
    """Draws both robots from the store; `scene` holds those of the open set."""

    scene: Scene

    def __init__(self, store: Store, server: viser.ViserServer, queue: EventQueue) -> None:
        self._store, self._server, self._queue = store, server, queue
        self._cameras = cameras = Cameras(server)
        self.watched = cameras.watched  # whether a page is shown
        self.playback = Playback(store.clock, lambda: self.watched())
        self._placed: tuple[str, tuple[str, int]] | None = None  # layout and camera
        store.subscribe(Changed.OPENED, self._build)
        store.subscribe(Changed.OPENED | Changed.GROUP, self._carry)
        store.subscribe(
            Changed.OPENED | Changed.GROUP | Changed.RESULT | Changed.DERIVED | Changed.DIAGNOSIS,
            self._colour,
        )
        motion = Changed.OPENED | Changed.GROUP | Changed.RESULT | Changed.DERIVED
        store.subscribe(motion | Changed.VIEW, self._draw)
        store.subscribe(Changed.HIGHLIGHT, self._mark)
        store.subscribe(Changed.TICK, cameras.tick)
        store.subscribe(Changed.CLOSED, self.playback.close)

        @server.on_client_connect
        async def _(client: viser.ClientHandle) -> None:
            queue.call(cameras.aim, client)

            @client.camera.on_update
            async def _(camera: viser.CameraHandle) -> None:
                queue.put(Event(("resized", camera.client.client_id), cameras.resized, camera.client))

        @server.on_client_disconnect
        async def _(client: viser.ClientHandle) -> None:
            queue.call(cameras.gone, client)

    def _clicked(self, joint: int) -> None:
        self._queue.put(Event(self, self._click, joint))

    def _click(self, joint: int) -> None:
        self._store.select(joint=joint)

    def _build(self) -> None:
        robot, shape = self._store.measurements.robot, self._store.opened.shape
        self._stage = scene_layout(robot, shape, self._store.motion.theta)
        self.playback.draw = None
        with self.playback.lock:
            if hasattr(self, "scene"):
                self.scene.remove()
            self.scene = Scene(self._server, robot, shape, self._stage, self._clicked)
        self._place()

    def _place(self) -> None:
        layout, camera = self._placed = self._store.view.layout, self._store.view.camera
        with self.playback.lock:
            self.scene.place(layout)
            self._cameras.show(self._stage, layout, camera[0])

    def _carry(self) -> None:
        for nodes in (self.scene.measured, self.scene.identified):
            nodes.carry(self._store.group.bodies)

    def _colour(self) -> None:
        found = self._store.link_colours
        grey = [COLOURS.body] * self._store.measurements.n
        self.scene.measured.colour(grey if found is None else found.colours)

    def _poses(self) -> Callable[[float], Positions]:
        """The positions of both robots over time [s], as they are drawn."""
        motion, deflection, view = self._store.motion, self._store.deflection, self._store.view
        return lambda time: motion.pose(time, deflection, view.error, view.link_side)

    def _draw(self) -> None:
        store, scene, motion, view = self._store, self.scene, self._store.motion, self._store.view
        if (view.layout, view.camera) != self._placed:
            self._place()
        poses = self._poses()

        def draw(time: float) -> None:
            scene.pose(*poses(time), motion.torque_shares(time) if view.torque else None)

        self.playback.draw = draw
        simulated, why = store.measurements.simulated, self._why_no_model()
        scene.labels(*scene_labels(motion, store.deflection, view.error, why, simulated, view.link_side))
        drawn = [poses(float(time)) for time in self._instants(TRAIL_POINTS)]
        scene.measured.trail([measured for measured, _ in drawn])
        scene.identified.trail([identified for _, identified in drawn])

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
