"""The robot that experiments are designed for: its model, payloads, controller and sensors."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flexviz.analysis.identification import FitSettings, identify
from flexviz.base.arrays import Array
from flexviz.base.errors import Cancelled, InputError
from flexviz.base.progress import ProgressCallback, StopCallback, ignore, never
from flexviz.data.measurements import Group, MeasurementSet, Segment, read_set
from flexviz.data.noise import segments_noise
from flexviz.model.simulation import PDController, Plan, Reference, follow, inject, make_plan, plan_from_set
from flexviz.robot.model import FlexibleModel
from flexviz.robot.robot import PayloadBody, Robot
from flexviz.robot.robot_files import DESCRIPTION_SUFFIXES


@dataclass(frozen=True, eq=False)
class Planned:
    """A trajectory–payload group to record: from rest to rest, `duration` in s."""

    name: str
    payload: str
    reference: Reference
    duration: float


@dataclass(frozen=True, eq=False)
class Subject:
    """A robot to design experiments for."""

    # name, robot: of the set, the preset or the URDF
    name: str
    robot: Robot
    models: tuple[FlexibleModel, ...]  # the model; or two that differ in one effect, to be told apart
    payloads: dict[str, tuple[PayloadBody, ...]]  # name → bodies
    controller: PDController  # that follows the references
    noise: tuple[Array, Array]  # standard deviations of θ [rad] and τ [Nm] per raw sample, shape (n,) each
    step: float  # of the raw samples [s]
    recorded: MeasurementSet | None = None  # the groups recorded so far; None without

    @property
    def model(self) -> FlexibleModel:
        """The (first) model, by which motions are predicted."""
        return self.models[0]

    def predicted(self, groups: Sequence[Planned], step: float, seed: int | None = None) -> MeasurementSet:
        """The set that `groups` would give, sampled with `step` [s]; with noise if there is a seed."""
        made = []
        for k, planned in enumerate(groups):
            bodies = self.payloads[planned.payload]
            time = np.arange(round(planned.duration / step) + 1) * step
            run = follow(
                self.robot,
                self.model,
                planned.reference,
                time,
                self.controller,
                payload=bodies,
                payload_name=planned.payload,
                group=planned.name,
            )
            theta, tau = run.theta, run.tau
            if seed is not None:
                rng = np.random.default_rng([seed, k])
                share = np.sqrt(self.step / step)  # a slower record of the same noise density
                theta = theta + share * self.noise[0] * rng.standard_normal(theta.shape)
                tau = tau + share * self.noise[1] * rng.standard_normal(tau.shape)
            segment = Segment(time, theta, tau, step)
            name, file = planned.name, Path(planned.name)
            made.append(Group(name, name, planned.payload, bodies, False, file, (segment,), time, q=run.q))
        return MeasurementSet(
            path=Path(self.name),
            name=self.name,
            robot=self.robot,
            joints=self.robot.joints,
            torque_hold=0.0,
            initial_stiffness=self.model.stiffness,
            initial_motor_inertia=self.model.motor_inertia,
            kp=None,
            kd=None,
            effects=(),
            payloads=self.payloads,
            groups=tuple(made),
            torque="motor" if self.model.motor_inertia.any() else "joint",
        )


def subject_of(
    source: str | Path | Plan | MeasurementSet,
    effects: Iterable[str] = (),
    separate: Sequence[str] = (),
    *,
    progress: ProgressCallback = ignore,
    should_stop: StopCallback = never,
) -> Subject:
    """The subject of a measurement set (identified first), a preset, a URDF, or a plan.

    Args:
        source: the set (or its folder), the name of a preset, a `.urdf`, or a plan.
        effects: further effects of its model.
        separate: two effects to tell apart; each is fitted to the set, or has its typical size without one.
    """
    wanted = tuple(effects)
    if (
        isinstance(source, str | Path)
        and Path(source).exists()
        and Path(source).suffix.lower() not in DESCRIPTION_SUFFIXES
    ):
        source = read_set(source)
    variants = [(*wanted, one) for one in separate] or [wanted]
    if isinstance(source, MeasurementSet):
        if source.drive is not None:
            message = "its joints follow goals, and motions are designed by the torque equation"
            raise InputError(f"{message}; expected measured torques", file=source.path)
        return _of_set(source, variants, progress, should_stop)
    plan = source if isinstance(source, Plan) else make_plan(source)
    models = tuple(inject(plan, variant).model for variant in variants)
    step = plan.groups[0].record_step or plan.controller.cycle
    noise = tuple(
        np.broadcast_to(x, plan.robot.n) for x in (plan.sensors.theta_noise, plan.sensors.torque_noise)
    )
    return Subject(
        plan.name, plan.robot, models, dict(plan.payloads), plan.controller, (noise[0], noise[1]), step
    )


def _of_set(
    measurements: MeasurementSet,
    variants: Sequence[Sequence[str]],
    progress: ProgressCallback,
    should_stop: StopCallback,
) -> Subject:
    """The subject with the models identified from its set."""
    models = []
    for variant in variants:
        quick = FitSettings(effects=tuple(variant), refine=False)
        found = identify(measurements, quick, progress=progress, should_stop=should_stop)
        if should_stop():
            raise Cancelled
        if not np.isfinite(found.covariance).all() or not all(np.isfinite(p.value) for p in found.parameters):
            raise InputError(
                "the model cannot be identified from this set, so that its motion cannot be predicted",
                file=measurements.path,
            )
        models.append(found.model)
    plan = plan_from_set(measurements)
    segments = [s for g in measurements.groups for s in g.segments]
    return Subject(
        measurements.name,
        measurements.robot,
        tuple(models),
        dict(measurements.payloads),
        plan.controller,
        segments_noise(segments),
        segments[0].step,
        measurements,
    )
