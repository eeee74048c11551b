"""Sends an analysis to an open recording, part by part."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from flexviz import __version__
from flexviz.analysis.diagnosis import Diagnosis, Step
from flexviz.analysis.identification import Identification
from flexviz.base.iteration import Iteration
from flexviz.content.records import ResidualMap
from flexviz.content.scene import RobotMotion, with_replay
from flexviz.content.view import free_chart, staircase_chart
from flexviz.content.wording import as_markdown, verdict_text
from flexviz.data.measurements import Group, MeasurementSet
from flexviz.model.observers import Observer
from flexviz.model.simulation import Run
from flexviz.outlets.recording import signals, texts
from flexviz.outlets.recording.charts import (
    MAX_EVIDENCE,
    send_charts,
    send_evidence,
    send_laws,
    send_maps,
    step_names,
)
from flexviz.outlets.recording.layout import blueprint
from flexviz.outlets.recording.optimiser import Solve
from flexviz.outlets.recording.paths import ABOUT, LOG, observer_name, path
from flexviz.outlets.recording.reading import Recorded
from flexviz.outlets.recording.scene import RobotScene
from flexviz.outlets.recording.signals import stride_for
from flexviz.outlets.recording.stream import Stream

MAX_SAMPLES = 10_000  # per signal and group
ITERATIONS_INTERVAL = 2.0  # [s] between two batches of iterations: sending them slows the solver
Check = Callable[[str, float], object]  # called between the parts with the next one and the share done


class Recorder:
    """Sends the analysis of one measurement set; methods may be called in any order."""

    def __init__(
        self, measurements: MeasurementSet, stream: Stream, samples: int = MAX_SAMPLES, both: bool = True
    ) -> None:
        """`both`: leave room for an identified robot beside the measured one."""
        self.measurements = measurements
        self.stream = stream
        self.samples = samples
        self._scene = RobotScene(stream, measurements, both)
        self._rearranged = False
        self._lines: list[str] = []
        self._flushed = time.monotonic()
        self.solves: list[Solve] = []
        self.diagnoses: list[Diagnosis] = []
        self._observers: dict[str, Observer] = {}

    def measured(self, check: Check | None = None) -> None:
        """Send the set, its signals and every group's measured robot; without a check, flush in between."""
        measurements, stream, check = self.measurements, self.stream, check or self._flush_part
        stream.name(measurements.name + (" (simulated data)" if measurements.simulated else ""))
        stream.property(
            "flexviz",
            set=measurements.name,
            simulated=measurements.simulated,
            robot=measurements.robot.name,
            version=__version__,
            joints=list(measurements.joints),
            groups=[group.name for group in measurements.groups],
        )
        for group in measurements.groups:
            stream.property(
                f"group {group.name}",
                trajectory=group.trajectory,
                payload=group.payload,
                validation=group.validation,
                seconds=group.duration,
                samples=group.samples,
            )
        check("reading the robot's shape", 0.0)
        self._describe()
        self.arrange()
        for done, group in enumerate(measurements.groups):
            check(f"{group.name}: measured signals and motion", done / len(measurements.groups))
            signals.send_measured(stream, measurements, group, self.samples)
            motion = self._scene.motion(group)
            label = "measured (simulated data)" if measurements.simulated else "measured"
            self._scene.send(group, "measured", motion.theta, label)
            self._describe_group(group, motion)
        self.note(f"measurement set {measurements.name}")

    def session(self, **values: Any) -> None:
        """Properties of the session, such as settings, steps and notes: texts, numbers or lists."""
        self.stream.property("session", **values)

    def observe(self, observer: Observer, check: Check | None = None) -> None:
        """Send all states of an observer in every group, once; without a check, flush in between."""
        name, check = observer_name(observer), check or self._flush_part
        if name in self._observers:
            return
        self.note(f"observer {name}")
        for done, group in enumerate(self.measurements.groups):
            check(f"{group.name}: observer states", done / len(self.measurements.groups))
            signals.send_states(self.stream, self.measurements, group, observer, self.samples)
        self._observers[name] = observer
        self.arrange()

    def start(self, label: str = "") -> Solve:
        """Start a solve: later iterations and the next result belong to it."""
        solve = Solve(self.stream, len(self.solves) + 1, label)
        self.solves.append(solve)
        self.note(f"result {solve.number}{f' ({label})' if label else ''}: started")
        self.arrange()
        return solve

    def iteration(self, iteration: Iteration, seconds: float | None = None) -> None:
        """Send an iteration of the newest solve, `seconds` [s] after its start (None: now)."""
        self._newest().add(iteration, seconds)
        if time.monotonic() - self._flushed > ITERATIONS_INTERVAL:
            self.flush()

    def result(self, result: Identification, label: str = "") -> None:
        """Send the result of the running solve, or of a new one."""
        if not self.solves or self.solves[-1].result is not None:
            self.start(label)
        solve = self.solves[-1]
        solve.label = label or solve.label
        solve.finish(result)
        for group, residual in result.residuals.items():
            self._series(("groups", group), residual, ("residual", "torque", "q"))
        where = path("results", solve.number, "about")
        self.stream.text(where, texts.result_text(result, solve.number, solve.label))
        more = {"label": solve.label, "effects": [effect.text for effect in result.model.effects]}
        self._json(path("results", solve.number, "json"), result.to_dict() | more)
        self.note(f"result {solve.number}: {result.message}")
        self._describe()
        self.arrange()

    def run(self, group: str, run: Run) -> None:
        """Send the newest result's model, simulated in a group."""
        place = self.measurements.group(group)
        motion = with_replay(self._scene.motion(place), run)
        self._series(("groups", group, "simulated"), run, ("theta", "q", "tau"), "simulated")
        self._scene.send(place, "identified", motion.model_theta, f"identified, result {len(self.solves)}")
        self._describe_group(place, motion)

    def no_run(self, group: str, reason: str) -> None:
        """Say why the newest result's model could not be simulated in a group."""
        place = self.measurements.group(group)
        self._describe_group(place, self._scene.motion(place), reason)

    def maps(self, maps: Sequence[ResidualMap]) -> None:
        """Send where the newest result's model fails."""
        solve = self._newest()
        send_maps(self.stream, path("results", solve.number), self.measurements.joints, maps)
        solve.mapped = True
        self.arrange()

    def diagnosis(self, diagnosis: Diagnosis, steps: Sequence[Step] = ()) -> None:
        """Send a diagnosis with its evidence; `steps` replaces its own model steps."""
        self.diagnoses.append(diagnosis)
        number, joints = len(self.diagnoses), self.measurements.joints
        where = path("diagnoses", number)
        self.stream.text(path("diagnoses", number, "verdict"), texts.diagnosis_text(diagnosis))
        self._json(path("diagnoses", number, "json"), diagnosis.to_dict())
        steps = steps or diagnosis.steps
        staircase = staircase_chart(steps, ticks=step_names(steps))
        send_charts(self.stream, f"{where}/staircase", [staircase])
        send_maps(self.stream, where, joints, diagnosis.maps)
        found = [one.law for each in self.diagnoses for one in each.findings if one.law is not None]
        laws = {(law.effect, law.joint, law.group, law.payload): law for law in found}
        send_laws(self.stream, where, list(laws.values()))
        send_charts(self.stream, f"{where}/free", [free_chart(diagnosis.free_curve)])
        for rank, finding in enumerate(diagnosis.findings[:MAX_EVIDENCE], 1):
            send_evidence(self.stream, number, rank, finding)
        self.note(f"diagnosis {number}: {verdict_text(diagnosis)}")
        self._describe()
        self.arrange()

    def flush(self) -> None:
        """Write everything so far."""
        if self.solves:
            self.solves[-1].flush()
        if self._rearranged:
            self.stream.blueprint(self.layout())
            self._rearranged = False
        self.stream.flush()
        self._flushed = time.monotonic()

    def _flush_part(self, what: str, share: float) -> None:
        self.flush()

    def finish(self, complete: bool = True) -> Recorded:
        """Close the recording and move it into place.

        Raises:
            InputError: see `Target.finish`.
        """
        if complete:
            self.flush()
        self.stream.close()
        return self.stream.target.finish(self.stream.entities, self.layout(), complete)

    def note(self, text: str) -> None:
        """Add a line to the log."""
        self._lines.append(f"- {time.strftime('%H:%M:%S')} {as_markdown(text)}")
        self.stream.text(LOG, "\n".join(self._lines))

    def arrange(self) -> None:
        """Update the layout at the next flush."""
        self._rearranged = True

    def layout(self) -> rrb.Blueprint:
        """The layout for the newest content."""
        observer = next(reversed(self._observers.values()), None)
        return blueprint(self.measurements, self._scene.stage, observer, self.solves, self.diagnoses)

    def _newest(self) -> Solve:
        return self.solves[-1] if self.solves else self.start()

    def _series(
        self, where: Sequence[str], series: signals.Series, names: Sequence[str], label: str = ""
    ) -> None:
        """Send signals of the newest result."""
        entity = ("results", self._newest().number, *where)
        joints = self.measurements.joints
        signals.send_series(self.stream, entity, joints, series, names, self.samples, label)

    def _describe(self) -> None:
        self.stream.text(ABOUT, texts.about_text(self.measurements, self.solves, self.diagnoses))

    def _describe_group(self, group: Group, motion: RobotMotion, reason: str = "") -> None:
        stride = stride_for(group.samples, self.samples)
        text = texts.group_text(self.measurements, group, motion, stride, reason)
        self.stream.text(path("groups", group.name, "about"), text)

    def _json(self, entity: str, document: dict) -> None:
        text = json.dumps(document, ensure_ascii=False, allow_nan=True)
        self.stream.log(entity, rr.TextDocument(text, media_type="application/json"), static=True)
