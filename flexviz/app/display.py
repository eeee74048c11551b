"""The 3D display: motion of both robots, colours, labels, trails and highlighted instants."""

from __future__ import annotations

import numpy as np
import viser

from flexviz.app.change import Changed
from flexviz.app.events import Event, EventQueue
from flexviz.app.playback import DrawnMotion, Playback
from flexviz.app.scene import Scene
from flexviz.app.store import Store
from flexviz.charts import COLOURS, rgb
from flexviz.scene import scene_labels, scene_layout
from flexviz.view import joint_colours, joint_rms

TRAIL_POINTS = 160
MARKED_POINTS = 300  # resolution of the highlighted path


class Display:
    """Draws both robots from the store."""

    def __init__(self, store: Store, server: viser.ViserServer, queue: EventQueue) -> None:
        self._store = store
        self.scene = Scene(server, lambda joint: queue.put(Event(self, self._click, joint)))
        self.playback = Playback(self.scene, store.clock)
        self._layout = store.view.layout
        store.subscribe(Changed.OPENED, self._build)
        store.subscribe(Changed.OPENED | Changed.GROUP, self._carry)
        store.subscribe(Changed.OPENED | Changed.GROUP | Changed.RESULT, self._colour)
        motion = Changed.OPENED | Changed.GROUP | Changed.RESULT | Changed.DERIVED
        store.subscribe(motion | Changed.VIEW, self._draw)
        store.subscribe(Changed.HIGHLIGHT, self._mark)
        store.subscribe(Changed.TICK, self.scene.tick)
        store.subscribe(Changed.CLOSED, self.playback.close)

        @server.on_client_connect
        async def _(client: viser.ClientHandle) -> None:
            queue.call(self.scene.aim, client)

            @client.camera.on_update
            async def _(camera: viser.CameraHandle) -> None:
                queue.put(Event("resized", self.scene.resized, camera.client))

        @server.on_client_disconnect
        async def _(client: viser.ClientHandle) -> None:
            queue.call(self.scene.gone, client)

    def _click(self, joint: int) -> None:
        self._store.select(joint=joint)

    def _build(self) -> None:
        """Build the scene for a new set."""
        robot, shape = self._store.measurements.robot, self._store.opened.shape
        self._layout = self._store.view.layout
        self.playback.show(None)
        with self.playback.hold():
            self.scene.build(robot, shape, scene_layout(robot, shape, self._store.motion.theta), self._layout)

    def _carry(self) -> None:
        bodies = self._store.group.bodies
        if self.scene.measured is not None and self.scene.identified is not None:
            self.scene.measured.carry(bodies, COLOURS.body)
            self.scene.identified.carry(bodies, rgb(COLOURS.model))

    def _colour(self) -> None:
        rms = joint_rms(self._store.analysis.identification, self._store.group.name)
        if self.scene.measured is not None:
            self.scene.measured.colour(joint_colours(rms, self._store.measurements.n))

    def _draw(self) -> None:
        """Draw the motion with labels and trails."""
        store, motion, view = self._store, self._store.motion, self._store.view
        if view.layout != self._layout:
            self._layout = view.layout
            with self.playback.hold():
                self.scene.place(self._layout)
        deflection = store.deflection
        self.playback.show(DrawnMotion(motion, deflection, view.error, view.link_side, view.torque))
        simulated = store.measurements.simulated
        self.scene.labels(
            *scene_labels(motion, deflection, view.error, self._why_no_model(), simulated, view.link_side)
        )
        every = motion.time[:: max(len(motion.time) // TRAIL_POINTS, 1)]
        drawn = [motion.pose(float(t), deflection, view.error, view.link_side) for t in every]
        if self.scene.measured is not None and self.scene.identified is not None:
            self.scene.measured.trail([measured for measured, _ in drawn], rgb(COLOURS.measured))
            self.scene.identified.trail([identified for _, identified in drawn], rgb(COLOURS.model))

    def _why_no_model(self) -> str:
        if self._store.analysis.identification is None:
            return "not identified yet"
        failed = self._store.group.name in self._store.derived.failed
        return "simulation failed" if failed else "being simulated"

    def _mark(self) -> None:
        """Highlight the selected instants on the measured robot's path."""
        store, highlight = self._store, self._store.highlight
        if highlight is None:
            self.scene.mark(None)
            return
        motion, view, deflection = store.motion, store.view, store.deflection
        every = motion.time[:: max(len(motion.time) // MARKED_POINTS, 1)]
        positions = [motion.pose(float(t), deflection, view.error, view.link_side)[0] for t in every]
        last = len(highlight.time) - 1
        chosen = (
            highlight.marked[np.clip(np.searchsorted(highlight.time, every), 0, last)] if last >= 0 else []
        )
        self.scene.mark(self.scene.path_pieces(positions, np.asarray(chosen, dtype=bool)))
