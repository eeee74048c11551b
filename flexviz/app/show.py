"""What is on the screen: the selected joint and group, the motion in 3D, the plots that belong to them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from flexviz.app.clock import Clock
from flexviz.app.playback import Playback, Showing
from flexviz.app.plots import PlotPanel
from flexviz.app.scene import Scene
from flexviz.app.work import Opened, replay_group
from flexviz.jobs import JobEvent
from flexviz.view.colours import BODY, MEASURED, MODEL, rgb
from flexviz.view.motion import measured_motion, nice_factor, scene_labels, with_replay
from flexviz.view.stage import stage
from flexviz.view.status import joint_colours, joint_rms

if TYPE_CHECKING:
    from flexviz.app.application import Application

TRAIL = 160  # points of a trail
MARKS = 300  # points of the path that may be highlighted


class Show:
    """Draws the session; only the loop's thread calls it."""

    def __init__(self, app: Application) -> None:
        self._app = app
        self.clock = Clock()
        self.scene = Scene(app.server, lambda joint: app.queue.put("click", joint))
        self.playback = Playback(self.scene, self.clock)
        self.plots = PlotPanel(app)
        self.joint = 0
        self._replays: dict[str, Any] = {}  # of the present result, by group
        self._failed: set[str] = set()  # groups along which it could not be simulated
        self._replayed: Any = None  # the result they belong to
        app.on("click", lambda joint: self.select(joint=joint))
        app.on("layout", self.layout)

    def opened(self, opened: Opened) -> None:
        """A new set: its robot on the stage, its first group playing."""
        measurements = opened.measurements
        self._replays, self._replayed, self.joint = {}, None, 0
        self.group = measurements.groups[0]
        self.motion = measured_motion(measurements, self.group, None)
        self.plots.where.opened()
        self._app.view.suggest_deflection(nice_factor(self.motion), anew=True)
        self.playback.show(None)
        with self.playback.hold():
            placed = stage(measurements.robot, opened.shape, self.motion.theta)
            self.scene.build(measurements.robot, opened.shape, placed, self._app.view.layout)

    def select(self, joint: int | None = None, group: str | None = None) -> None:
        """Show another joint, or another group, everywhere."""
        if joint is not None and joint != self.joint and 0 <= joint < self._app.measurements.n:
            self.joint = joint
            self._app.dock.refresh()
            self._app.observer.refresh()
            self.plots.show_signals()
            self.plots.show_states()
            self.show_diagnosis()
        if group is not None and group != self.group.name:
            self.group = self._app.measurements.group(group)
            self._app.dock.refresh()
            self.show_group()
            self._app.diagnose.findings.redraw()

    def show_group(self) -> None:
        """Draw the present group from its beginning."""
        start, end = self.group.segments[0].time[0], self.group.segments[-1].time[-1]
        self._app.view.span(float(start), float(end))
        for nodes, colour in ((self.scene.measured, BODY), (self.scene.identified, rgb(MODEL))):
            if nodes is not None:
                nodes.carry(self.group.bodies, colour)
        self.show_model()
        self.plots.show_states()

    def show_model(self) -> None:
        """Draw the present result: motion, colours, plots; simulate its own motion where that is missing."""
        measurements, result = self._app.measurements, self._app.session.analysis.identification
        if result is not self._replayed:
            self._replays, self._failed, self._replayed = {}, set(), result
        self.motion = measured_motion(measurements, self.group, result)
        self._app.view.suggest_deflection(nice_factor(self.motion))
        run = self._replays.get(self.group.name)
        if run is not None:
            self.motion = with_replay(self.motion, run)
        elif result is not None and self.group.name not in self._failed:
            self._app.worker.stop("replay")
            self._app.submit("replay", replay_group, measurements.path, result.model, self.group.name)
        rms = joint_rms(result, self.group.name)
        if self.scene.measured is not None:
            self.scene.measured.colour(joint_colours(rms, measurements.n))
        self._app.view.refresh()
        self.show_motion()
        self.plots.show_signals()
        self.show_diagnosis()

    def show_diagnosis(self) -> None:
        """Draw where the model fails and how the error fell."""
        self.plots.where.show()
        self.plots.show_compare()

    def marked(self, time: np.ndarray, inside: np.ndarray) -> np.ndarray:
        """Pieces (K, 2, 3) [m] of the measured robot's path where `inside` (M,) holds at `time` (M,)."""
        deflection, error = self._app.view.factors
        every = self.motion.time[:: max(len(self.motion.time) // MARKS, 1)]
        chosen = inside[np.clip(np.searchsorted(time, every), 0, len(time) - 1)] if len(time) else []
        link_side = self._app.view.link_side
        positions = [self.motion.pose(float(t), deflection, error, link_side)[0] for t in every]
        return self.scene.path_pieces(positions, np.asarray(chosen, dtype=bool))

    def show_motion(self) -> None:
        """Draw the present motion with the present factors, labels and trails."""
        view = self._app.view
        deflection, error = view.factors
        link_side = view.link_side
        self.playback.show(Showing(self.motion, deflection, error, link_side, view.torque))
        simulated = self._app.measurements.simulated
        self.scene.labels(
            *scene_labels(self.motion, deflection, error, self._why_no_model(), simulated, link_side)
        )
        every = self.motion.time[:: max(len(self.motion.time) // TRAIL, 1)]
        drawn = [self.motion.pose(float(t), deflection, error, link_side) for t in every]
        for nodes, index, colour in (
            (self.scene.measured, 0, MEASURED),
            (self.scene.identified, 1, MODEL),
        ):
            if nodes is not None:
                nodes.trail([pair[index] for pair in drawn], rgb(colour))

    def _why_no_model(self) -> str:
        if self._app.session.analysis.identification is None:
            return "not identified yet"
        return "simulation failed" if self.group.name in self._failed else "being simulated"

    def layout(self, layout: str) -> None:
        """Side by side or overlaid."""
        with self.playback.hold():
            self.scene.place(layout)
        self.show_motion()

    def heard(self, event: JobEvent) -> None:
        """What the simulation of the identified model has to say."""
        _, model, group = event.job.args
        result = self._app.session.analysis.identification
        if result is None or model is not result.model:
            return  # the result has been replaced meanwhile
        if event.kind == "done":
            self._replays[group] = event.value
            if group == self.group.name:
                self.show_model()
        elif event.kind == "failed":
            self._failed.add(group)
            self.show_motion()
            self._app.fail(f"the identified model could not be simulated: {event.value}")

    def tick(self) -> None:
        """Let playheads and the time slider follow the clock."""
        if self.clock.playing:
            self._app.view.tick()
        self.plots.tick(self.clock.time)
