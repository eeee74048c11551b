"""What is on the screen: the selected joint and group, the motion in 3D, the plots that belong to them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from flexviz.app.clock import Clock
from flexviz.app.playback import Playback, Showing
from flexviz.app.plots import PlotPanel
from flexviz.app.scene import Scene
from flexviz.app.work import Opened, map_set, replay_group
from flexviz.charts import COLOURS, rgb
from flexviz.jobs import Job, JobEvent
from flexviz.scene import measured_motion, nice_factor, scene_labels, scene_layout, with_replay
from flexviz.view import joint_colours, joint_rms

if TYPE_CHECKING:
    from flexviz.app.application import Application
    from flexviz.diagnosis import FreeCurve, ResidualMap
    from flexviz.identification import Identification

TRAIL = 160  # points of a trail
IDLE_JOBS = ("replay", "maps")  # done where nothing else runs, and again where something came between
KEPT = 8  # results whose motions are kept
MARKS = 300  # points of the path that may be highlighted


@dataclass(eq=False)
class Known:
    """What was worked out about one result: its model's own motion by group, its maps, and what failed."""

    result: Identification | None
    replays: dict[str, Any] = field(default_factory=dict)
    maps: tuple[ResidualMap, ...] = ()
    failed: set[str] = field(default_factory=set)  # groups, and "maps"


class Show:
    """Draws the session; only the loop's thread calls it."""

    def __init__(self, app: Application) -> None:
        self._app = app
        self.clock = Clock()
        self.scene = Scene(app.server, lambda joint: app.queue.put("click", joint))
        self.playback = Playback(self.scene, self.clock)
        self.plots = PlotPanel(app)
        self.joint = 0
        self._known: list[Known] = [Known(None)]  # the present result's last
        self._asked: dict[str, Job] = {}  # what is under way
        app.on("click", lambda joint: self.select(joint=joint))
        app.on("layout", self.layout)

    def opened(self, opened: Opened) -> None:
        """A new set: its robot on the stage, its first group playing."""
        measurements = opened.measurements
        self._known, self.joint = [Known(None)], 0
        self.group = measurements.groups[0]
        self.motion = measured_motion(measurements, self.group, None)
        self.plots.where.opened()
        self._app.view.suggest_deflection(nice_factor(self.motion), anew=True)
        self.playback.show(None)
        with self.playback.hold():
            placed = scene_layout(measurements.robot, opened.shape, self.motion.theta)
            self.scene.build(measurements.robot, opened.shape, placed, self._app.view.layout)

    def select(self, joint: int | None = None, group: str | None = None) -> None:
        """Show another joint, or another group, everywhere."""
        if joint is not None and joint != self.joint and 0 <= joint < self._app.measurements.n:
            self.joint = joint
            self._app.dock.refresh()
            self._app.observer.refresh()
            self._app.view.refresh()
            self.plots.show_signals()
            self.plots.show_states()
            self.show_diagnosis()
        if group is not None and group != self.group.name:
            self.group = self._app.measurements.group(group)
            self._app.dock.refresh()
            self.show_group()
            self._app.diagnose.findings.redraw()

    def next_joint(self) -> None:
        """Show the next joint, after the last one the first."""
        self.select(joint=(self.joint + 1) % self._app.measurements.n)

    def next_group(self) -> None:
        """Show the next group, after the last one the first."""
        names = [group.name for group in self._app.measurements.groups]
        self.select(group=names[(names.index(self.group.name) + 1) % len(names)])

    def show_group(self) -> None:
        """Draw the present group from its beginning."""
        start, end = self.group.segments[0].time[0], self.group.segments[-1].time[-1]
        self._app.view.span(float(start), float(end))
        for nodes, colour in (
            (self.scene.measured, COLOURS.body),
            (self.scene.identified, rgb(COLOURS.model)),
        ):
            if nodes is not None:
                nodes.carry(self.group.bodies, colour)
        self.show_model()
        self.plots.show_states()

    @property
    def maps(self) -> tuple[ResidualMap, ...]:
        """Where the present model's residual lives: as the diagnosis found it, or as it was looked up."""
        analysis = self._app.session.analysis
        if analysis.diagnosis is not None and analysis.diagnosis_up_to_date and analysis.diagnosis.maps:
            return analysis.diagnosis.maps
        return self.known.maps

    @property
    def free_curve(self) -> FreeCurve | None:
        """The curve for what no effect explains, where the diagnosis drew one."""
        analysis = self._app.session.analysis
        return analysis.diagnosis.free_curve if analysis.diagnosis and analysis.diagnosis_up_to_date else None

    @property
    def known(self) -> Known:
        """What is known about the present result; kept for a while, so that undo shows it at once."""
        result = self._app.session.analysis.identification
        if self._known[-1].result is not result:
            same = [known for known in self._known if known.result is result] or [Known(result)]
            others = [known for known in self._known if known.result is not result]
            self._known = [*others[1 - KEPT :], same[0]]
        return self._known[-1]

    def show_model(self) -> None:
        """Draw the present result: motion, colours, plots."""
        measurements, result = self._app.measurements, self._app.session.analysis.identification
        self.motion = measured_motion(measurements, self.group, result)
        self._app.view.suggest_deflection(nice_factor(self.motion))
        run = self.known.replays.get(self.group.name)
        if run is not None:
            self.motion = with_replay(self.motion, run)
        rms = joint_rms(result, self.group.name)
        if self.scene.measured is not None:
            self.scene.measured.colour(joint_colours(rms, measurements.n))
        self._app.view.refresh()
        self.show_motion()
        self.plots.show_signals()
        self.show_diagnosis()
        self.fill()

    def fill(self) -> None:
        """Work out what the screen lacks where nothing else runs: the model's own motion, its maps."""
        analysis = self._app.session.analysis
        known, group = self.known, self.group.name
        result = known.result
        if result is None or self._app.running:
            return
        if group not in known.replays and group not in known.failed:
            self._ask("replay", replay_group, analysis.path, result.model, group)
        if not self.maps and "maps" not in known.failed and analysis.fitted is not None:
            _, _, _, roles, effects, _ = analysis.fitted
            settings = replace(analysis.without_result(), roles=roles, effects=effects)
            self._ask("maps", map_set, settings, result.model)

    def _ask(self, key: str, function: Any, *args: Any) -> None:
        """Have a job done, unless that is under way."""
        asked = self._asked.get(key)
        if asked is not None and asked.args[1:] == args[1:]:
            return
        self._app.worker.stop(key)
        self._asked[key] = self._app.submit(key, function, *args)

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
            (self.scene.measured, 0, COLOURS.measured),
            (self.scene.identified, 1, COLOURS.model),
        ):
            if nodes is not None:
                nodes.trail([pair[index] for pair in drawn], rgb(colour))

    def _why_no_model(self) -> str:
        if self._app.session.analysis.identification is None:
            return "not identified yet"
        return "simulation failed" if self.group.name in self.known.failed else "being simulated"

    def layout(self, layout: str) -> None:
        """Side by side or overlaid."""
        with self.playback.hold():
            self.scene.place(layout)
        self.show_motion()

    def heard(self, event: JobEvent) -> None:
        """What the simulation of the identified model, or the search for where it fails, has to say."""
        key, model = event.job.key, event.job.args[1]
        if event.kind in ("done", "failed", "stopped") and self._asked.get(key) is event.job:
            del self._asked[key]
        of = next((k for k in self._known if k.result is not None and k.result.model is model), None)
        if of is None or of.result is None or event.kind not in ("done", "failed"):
            return  # of a result that nobody will see again, or asked for again
        name = event.job.args[2] if key == "replay" else key
        if event.kind == "failed":
            of.failed.add(name)
            what = "simulated" if key == "replay" else "looked at for where it fails"
            self._app.fail(f"the identified model could not be {what}: {event.value}")
            self.show_motion()
        elif key == "replay":
            of.replays[name] = event.value
            self._app.recordings.replayed(of.result, name, event.value)
            if of is self.known and name == self.group.name:
                self.show_model()
        else:
            of.maps = event.value
            self._app.recordings.mapped(of.result, event.value)
            self.plots.where.show()

    def tick(self) -> None:
        """Let playheads and the time slider follow the clock."""
        if self.clock.playing:
            self._app.view.tick()
        self.plots.move(self.clock.time)
        self.scene.tick()
