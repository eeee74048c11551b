"""A measurement set before its simulation: robot, true parameters, payloads, groups, controller, sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from flexviz.base.facts import Fact
from flexviz.base.progress import ProgressCallback, StopCallback, ignore, never
from flexviz.model.compensation import FrictionTable
from flexviz.model.simulation.control import PDController
from flexviz.model.simulation.laws import ExtraLaw
from flexviz.model.simulation.plant import Array
from flexviz.model.simulation.references import Reference
from flexviz.model.simulation.run import Run, simulate_run
from flexviz.model.simulation.sensors import Seed, Sensors
from flexviz.robot.model import FlexibleModel
from flexviz.robot.robot import PayloadBody, Robot


@dataclass(frozen=True, eq=False)
class PlannedGroup:
    """One trajectory with one payload.

    Attributes:
        duration: [s].
        record_step: the recording's step [s]; None: every controller cycle.
        temperature: of each joint [°C], stated in the set.
    """

    name: str
    trajectory: str
    payload: str
    reference: Reference
    duration: float
    record_step: float | None = None
    validation: bool = False
    temperature: tuple[float, ...] | None = None


def four_groups(
    motions: Sequence[Reference], duration: float, validation_payload: str
) -> tuple[PlannedGroup, ...]:
    """Groups t1p1, t2p2, t3p3 to fit, and t4 with one of the payloads for validation; recorded at 1 kHz."""
    payloads = ("p1", "p2", "p3", validation_payload)
    return tuple(
        PlannedGroup(f"t{k}{payload}", f"t{k}", payload, motion, duration, 0.001, validation=k == 4)
        for k, (motion, payload) in enumerate(zip(motions, payloads, strict=True), 1)
    )


@dataclass(frozen=True, eq=False)
class Plan:
    """A measurement set before its simulation.

    Attributes:
        robot: with the CAD inertias that the set contains.
        source: the robot's name or file in the set.
        model: the true parameters and effects.
        initial_stiffness, initial_motor_inertia: (n,) rough values for the set.
        single: write the signals as float32.
        extra: also write link positions and joint torques.
        note: origin of the true values, for truth.json.
        files: further files of the set: name -> text, or the path of a file to copy.
        laws: (joint, law) beyond the library's; not in truth.json.
        step: largest integration step [s]; None: from the fastest motion.
        compensation: friction that the controller compensates; the recorded torque is without it.
    """

    name: str
    robot: Robot
    source: str
    model: FlexibleModel
    payloads: dict[str, tuple[PayloadBody, ...]]
    groups: tuple[PlannedGroup, ...]
    controller: PDController
    sensors: Sensors
    initial_stiffness: Array | None = None
    initial_motor_inertia: Array | None = None
    start: str = "rest"
    effects: tuple[str, ...] = ()
    single: bool = False
    extra: bool = True
    note: Fact | str = ""
    files: Mapping[str, str | Path] = field(default_factory=dict)
    laws: tuple[tuple[str, ExtraLaw], ...] = ()
    step: float | None = None
    compensation: FrictionTable | None = None

    def run(
        self,
        group: PlannedGroup,
        *,
        seed: Seed = None,
        progress: ProgressCallback = ignore,
        should_stop: StopCallback = never,
    ) -> Run:
        """Simulate one group without sensor noise, unless it is fed back (then `seed` matters)."""
        sensors = self.sensors if self.sensors.feedback else Sensors(torque_filter=self.sensors.torque_filter)
        return simulate_run(
            self.robot,
            self.model,
            payload=self.payloads[group.payload],
            reference=group.reference,
            controller=self.controller,
            duration=group.duration,
            step=self.step,
            record_step=group.record_step,
            start=self.start,
            sensors=sensors,
            seed=seed,
            group=group.name,
            payload_name=group.payload,
            temperature=group.temperature,
            laws=self.laws,
            compensation=self.compensation,
            progress=progress,
            should_stop=should_stop,
        )
