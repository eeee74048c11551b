"""What accompanies the outcome of an identification: static tests, data that are not used."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from flexviz.analysis.identification.plain_fit import PlainFit
from flexviz.analysis.identification.result import Identification
from flexviz.base.facts import Fact, Remedy
from flexviz.base.units import joint_units
from flexviz.checks import seen_limits, silent_joints, unmeasured
from flexviz.data.measurements import Group, MeasurementSet
from flexviz.robot.model import FlexibleModel

APART = 3.0  # standard errors of a static test, from which the motion contradicts it


def holds_used(plain: PlainFit, model: FlexibleModel) -> Iterator[Fact]:
    """What static tests added; its joints are those whose stiffness the motion pulls away from them."""
    holds = plain.start.prior.holds
    if holds is not None:
        clamped = holds.clamped
        away = np.abs(1 / model.stiffness - clamped.value) * np.sqrt(clamped.precision)
        apart = tuple(joint for joint, one in zip(model.joints, away, strict=True) if one > APART)
        yield Fact("holds-used", "odd" if apart else "note", apart, values={"count": holds.count})


def groups_not_used(result: Identification, groups: Sequence[Group]) -> Iterator[Fact]:
    """The groups that are not used, if any."""
    used = (*result.groups, *result.validation_groups)
    if names := tuple(group.name for group in groups if group.name not in used):
        yield Fact("groups-not-used", "odd", groups=names)


def of_samples(measurements: MeasurementSet) -> Iterator[Fact]:
    """Torques that are no signal, or stand at a limit; angles that no sensor has measured."""
    yield from torques_without_signal(measurements)
    yield from saturated_torques(measurements)
    yield from unmeasured_angles(measurements)


def torques_without_signal(measurements: MeasurementSet) -> Iterator[Fact]:
    """Joints whose torque is no signal: its few levels, or the share of it that the motion explains."""
    if found := silent_joints(measurements):
        names, remedy = tuple(found), Remedy("model.no_torque", tuple(found), "set")
        instead = {
            "levels": tuple(tuple(what.get("values", ())) for what in found.values()),
            "explained": tuple(what.get("share") for what in found.values()),
        }
        yield Fact("no-torque", "wrong", names, values=instead, remedy=remedy)


def unmeasured_angles(measurements: MeasurementSet) -> Iterator[Fact]:
    """Joints whose angle has less noise [rad] than any encoder, beside a measured torque."""
    segments = [segment for group in measurements.groups for segment in group.segments]
    if found := unmeasured(segments):
        joints = tuple(measurements.joints[j] for j in found)
        units = joint_units("rad", (measurements.robot.prismatic[j] for j in found))
        yield Fact("reference", "odd", joints, values={"noise": tuple(found.values()), "units": units})


def saturated_torques(measurements: MeasurementSet) -> Iterator[Fact]:
    """Joints whose torque stands at a limit, with these limits [Nm]; a side without one is missing."""
    if found := seen_limits(measurements):
        limits = {
            "lower": tuple(one.lower if np.isfinite(one.lower) else None for one in found),
            "upper": tuple(one.upper if np.isfinite(one.upper) else None for one in found),
            "tolerance": tuple(one.tolerance for one in found),
            "rows": tuple(one.rows for one in found),
            "units": joint_units("Nm", (measurements.robot.prismatic[one.joint] for one in found)),
        }
        joints = tuple(measurements.joints[one.joint] for one in found)
        yield Fact("torque-saturated", "odd", joints, values=limits)
