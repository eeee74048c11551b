"""Measurement sets in memory from simulated plans."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from flexviz.analysis.designing import Design
from flexviz.data.measurements import Group, MeasurementSet, Segment
from flexviz.model.simulation import Plan, PlannedGroup, Run, move, record


def in_memory(plan: Plan, runs: dict[str, Run]) -> MeasurementSet:
    """The set that `write_plan` would write."""
    groups = []
    for planned in plan.groups:
        run = runs[planned.name]
        segment = Segment(run.time, run.theta, run.tau, float(run.time[1] - run.time[0]))
        bodies, file = plan.payloads[planned.payload], Path(planned.name)
        names = planned.name, planned.trajectory, planned.payload
        groups.append(Group(*names, bodies, planned.validation, file, (segment,), run.time))
    return MeasurementSet(
        path=Path(plan.name),
        name=plan.name,
        robot=plan.robot,
        joints=plan.robot.joints,
        torque_hold=next(iter(runs.values())).torque_hold,
        initial_stiffness=plan.initial_stiffness,
        initial_motor_inertia=plan.initial_motor_inertia,
        kp=plan.controller.kp,
        kd=plan.controller.kd,
        effects=plan.effects,
        payloads=plan.payloads,
        groups=tuple(groups),
    )


def noisy_sets(plan: Plan, seeds: Sequence[int]) -> Iterator[MeasurementSet]:
    """The plan's set with the noise of each seed; simulated once."""
    runs = move(plan)
    for seed in seeds:
        yield in_memory(plan, record(plan, runs, seed))


def designed_groups(design: Design, record_step: float | None) -> tuple[PlannedGroup, ...]:
    """The groups of a design, to simulate."""
    return tuple(
        PlannedGroup(one.name, one.name, one.payload, one.reference, one.duration, record_step)
        for one in (group.planned for group in design.groups)
    )


def without_validation(plan: Plan) -> Plan:
    """The plan without its validation group."""
    return replace(plan, groups=tuple(group for group in plan.groups if not group.validation))
