"""What the torques contradict: the most probable reading of the columns, as issues."""

from __future__ import annotations

from collections.abc import Mapping as Named
from dataclasses import replace
from typing import Any

import numpy as np

from flexviz.base.search import Search
from flexviz.checks.faults import Fault
from flexviz.checks.issues import Issue, Severity
from flexviz.checks.problem import ReadingModel, Readings
from flexviz.checks.reading import Reading
from flexviz.checks.rigid import Comparison
from flexviz.checks.thresholds import LIMITS, SURE
from flexviz.data.logs import Mapping

DOUBTFUL = ("zero", "coupling", "payload")  # which the shape of a torque does not prove


def most_probable(
    mapping: Mapping, comparison: Comparison, payloads_known: bool
) -> tuple[Readings, ReadingModel]:
    """The most probable reading; each of its faults makes it much more probable."""
    start = comparison.stated
    problem = Readings(mapping, comparison, start, payloads_known)
    found = _lowest(problem, problem.begin)
    fits = comparison.fits(start)
    if not found.faults and min(fit.share for fit in fits) > LIMITS.explained:
        return problem, found
    # a wrong sign and a wrong size hide one another: first the shape, then the size
    free = replace(start, free=np.ones(comparison.robot.n, bool))
    shapes = Readings(mapping, comparison, free, payloads_known)
    shape = _lowest(shapes, shapes.begin)
    other = ReadingModel(shape.faults, replace(shape.reading, free=start.free))
    other = _lowest(problem, other)
    return problem, min(found, other, key=lambda model: problem.score(model).total)


def _lowest(problem: Readings, start: ReadingModel) -> ReadingModel:
    """The most probable of the readings to which the search comes, if it explains the torques."""
    seen: list[ReadingModel] = []
    seen.append(Search(problem, seen.append).run(start))
    explaining = [model for model in seen if problem.explains(model)]
    return min([problem.begin, *explaining], key=lambda model: problem.score(model).total)


def check_torques(mapping: Mapping, comparison: Comparison, payloads_known: bool) -> list[Issue]:
    """Everything that the torques contradict: what is probably wrong, and joints that stay unexplained."""
    if not comparison.usable:
        return []
    problem, best = most_probable(mapping, comparison, payloads_known)
    now, found = comparison.stated, list[Issue]()
    for fault in best.faults:
        alike = problem.alike(best, fault)
        told: Fault | None = None if fault.values.get("untold") else fault
        if fault.values.get("converted"):  # only friction is coupled: nothing is wrong with the columns
            plain = [other for other in alike if other.kind == "coupling" and not other.values["converted"]]
            told, alike = (plain[0], [fault]) if plain else (None, [])
        if told is not None:
            found.append(_issue(mapping, comparison, now, told, alike, best))
        now = fault.change(now)
    return found + unexplained(mapping, comparison, best, {joint for one in found for joint in one.joints})


def unexplained(mapping: Mapping, comparison: Comparison, best: ReadingModel, known: set[str]) -> list[Issue]:
    """Joints whose torque the masses do not explain whatever is wrong."""
    poor = {}
    for joint, fit in zip(mapping.names, comparison.fits(best.reading), strict=True):
        # gravity and inertia that cancel, as near a resonance, leave less than the masses' own error
        error = LIMITS.mass_spread**2 * fit.parts
        if fit.share < LIMITS.unexplained and 1.0 - fit.share > error and joint not in known:
            poor[joint] = fit.share
    return [Issue("unexplained", "odd", tuple(poor), "tau", {"shares": poor})] if poor else []


def _issue(
    mapping: Mapping,
    comparison: Comparison,
    now: Reading,
    fault: Fault,
    alike: list[Fault],
    best: ReadingModel,
) -> Issue:
    """The issue that a fault resolves."""
    names = mapping.names
    before, after = comparison.fits(now), comparison.fits(fault.change(now))
    worst = max(range(len(after)), key=lambda j: after[j].score - before[j].score)
    facts = {
        "joint": names[worst],
        "explained_before": before[worst].share,
        "explained": after[worst].share,
        "times": _times(now, fault.change(now)),
        "gain": sum(a.score - b.score for a, b in zip(after, before, strict=True)),
    }
    doubtful = (
        any(other.kind != fault.kind for other in alike)
        or (fault.kind in DOUBTFUL and not (fault.kind == "zero" and fault.groups))
        or not _supported(comparison, now, fault)
        # of an unstated payload only the mass is known: the torque of a wrist may have any size
        or (
            fault.kind == "size"
            and len(fault.joints) < len(names)
            and any("mass" in other.values for other in best.faults)
        )
    )
    severity: Severity = "odd" if doubtful else "wrong"
    others = [_of(mapping, other, severity) for other in alike if other.name not in ("scale", "q")]
    others = [replace(one, values={**one.values, "all_joints": len(names)}) for one in others]
    issue = _of(mapping, fault, severity)
    return replace(issue, values={**issue.values, **facts}, alike=tuple(others))


def _of(mapping: Mapping, fault: Fault, severity: Severity) -> Issue:
    """A fault's facts; what it knows of joints, by their names."""
    names = mapping.names

    def named(value: Any) -> Any:
        return {names[j]: x for j, x in value.items()} if isinstance(value, Named) else value

    values = {key: named(value) for key, value in fault.values.items()}
    joints = tuple(names[j] for j in fault.joints)
    kind = "unit" if fault.kind == "size" else fault.kind
    return Issue(kind, severity, joints, fault.signal, values, fault.fixes, fault.proposals)


def _times(now: Reading, then: Reading) -> float:
    """By how much the columns as they are read are too large, at the joint where that is furthest from 1."""
    ratios = np.concatenate([(now.factor / then.factor).ravel(), (now.size / then.size).ravel()])
    sizes = np.log(np.abs(ratios))
    return float(np.exp(sizes[np.argmax(np.abs(sizes))]))


def _supported(comparison: Comparison, now: Reading, fault: Fault) -> bool:
    """Whether more than the shape of one joint's torque speaks for a fault.

    That is several joints' torques, friction or inertia below zero otherwise, the joints' range, or a size
    that no masses explain.
    """
    if fault.kind == "size":
        free = comparison.fits(replace(now, free=np.ones(len(now.sign), bool)))
        factors = np.array([free[j].slope for j in fault.joints])
        return bool(np.any(np.abs(np.log(factors)) > np.log(LIMITS.far_beyond)))
    reading = fault.change(now)
    before, after = comparison.fits(now), comparison.fits(reading)
    better = sum(b.score - a.score > SURE for a, b in zip(before, after, strict=True))
    range_too = np.sum(comparison.beyond(now)) > np.sum(comparison.beyond(reading))
    return better > 1 or bool(range_too) or any(comparison.unphysical(now, j) for j in fault.joints)
