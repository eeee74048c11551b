"""The texts of a recording, as Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from flexviz.measurements import Group, MeasurementSet
from flexviz.results import hints
from flexviz.scene import RobotMotion
from flexviz.statistics import NORMAL_95
from flexviz.wording import (
    MergedFinding,
    absorbed_list,
    as_markdown,
    confidence_range,
    finding_key,
    finding_name,
    found_shares,
    number,
    removes_text,
    share_text,
    span_text,
    tie_text,
    total_rms,
    values_text,
    verdict_text,
)

if TYPE_CHECKING:
    from flexviz.diagnosis import Diagnosis, Finding
    from flexviz.identification import Identification
    from flexviz.recording.optimiser import Solve

SIMULATED = "**Simulated data**: a simulator wrote this measurement set, no robot was recorded."
MAX_FINDINGS = 8
MAX_ABSORBED = 4  # per finding
MAX_LOCATIONS = 6  # joint and variable, where the final model fails
NOTABLE_SHARE = 0.01  # smallest share of the residual that is listed


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Lines of a Markdown table; cells must already be escaped."""
    return ["| " + " | ".join(row) + " |" for row in (header, ["---"] * len(header), *rows)]


def about_text(measurements: MeasurementSet, solves: Sequence[Solve], diagnoses: Sequence[Diagnosis]) -> str:
    """The set, every finished result with its error, the last verdict."""
    lines = [f"# {as_markdown(measurements.name)}", ""]
    if measurements.simulated:
        lines += [SIMULATED, ""]
    lines += [
        f"- robot: {as_markdown(measurements.robot.name)}, {measurements.n} joints",
        f"- groups: {', '.join(as_markdown(group_title(group)) for group in measurements.groups)}",
        "- 3D: both robots by their motor angles θ; the identified one is simulated",
        "",
    ]
    if diagnoses:
        lines += [f"**{as_markdown(verdict_text(diagnoses[-1]))}**", ""]
    rows = [
        [
            str(solve.number),
            as_markdown(solve.label or "the set's own model"),
            f"{result.observer_name}, {result.observer_entry.tuning}",
            *_errors(result.residual.rms, result.residual.rms_validation),
        ]
        for solve in solves
        if (result := solve.result) is not None
    ]
    if not rows:
        return "\n".join([*lines, "Nothing is identified yet."])
    header = ["", "model", "observer", "rms fit [Nm]", "rms validation [Nm]"]
    return "\n".join([*lines, *table(header, rows)])


def result_text(result: Identification, count: int, label: str) -> str:
    """One result: model, observer, parameters, error per joint."""
    refined = ", refined" if result.refined else ""
    effects = ", ".join(f"{e.effect}{f' on {e.joint}' if e.joint else ''}" for e in result.model.effects)
    held_out = as_markdown(", ".join(result.validation_groups)) or "nothing"
    lines = [
        f"# Result {count}{f': {as_markdown(label)}' if label else ''}",
        "",
        f"{'Converged' if result.converged else 'Not converged'}: {as_markdown(result.message)}",
        "",
        f"- effects in the model: {as_markdown(effects) or 'none'}",
        f"- observer `{result.observer_name}`, {result.observer_entry.tuning}{refined}",
        f"- fitted: {as_markdown(', '.join(result.groups))}; held out: {held_out}",
        f"- condition number {number(result.condition_number, 3)}; {result.seconds:.2f} s",
        "",
    ]
    rows = []
    for p in result.parameters:
        band = number(NORMAL_95 * p.std, 2) if np.isfinite(p.std) else "–"
        cells = (p.name, p.joint or "", number(p.value, 6), band, p.unit, p.identifiable)
        rows.append([as_markdown(cell) for cell in cells])
    lines += table(["parameter", "joint", "value", "± 95 %", "unit", "identifiable"], rows)
    residual = result.residual
    columns = (residual.rms, residual.rms_validation, residual.noise_floor)
    rows = [
        [as_markdown(joint), *(number(None if column is None else column[j], 4) for column in columns)]
        for j, joint in enumerate(residual.joints)
    ]
    header = ["joint", "rms fit [Nm]", "rms validation [Nm]", "noise floor [Nm]"]
    return "\n".join([*lines, "", *table(header, rows)])


def diagnosis_text(diagnosis: Diagnosis) -> str:
    """The verdict, the ranked findings, the staircase, where the model fails, notes."""
    verdict = verdict_text(diagnosis)
    lines = [f"# {as_markdown(verdict)}", ""]
    if diagnosis.stopped:
        lines += ["**Stopped before the end**: these are the results up to then.", ""]
    shares = found_shares(diagnosis)
    ranked = sorted(diagnosis.findings, key=lambda one: -shares.get(finding_key(one), -1.0))
    for rank, finding in enumerate(ranked[:MAX_FINDINGS], 1):
        lines += _finding_lines(MergedFinding((finding,), shares.get(finding_key(finding))), rank)
    more = len(diagnosis.findings) - MAX_FINDINGS
    if more > 0:
        lines += [f"… and {more} less likely.", ""]
    rows = [
        [
            "initial model" if step.added is None else f"+ {as_markdown(finding_name(step.added))}",
            *_errors(step.rms, step.rms_validation),
            step.verdict,
        ]
        for step in diagnosis.steps
    ]
    lines += ["## Errors step by step", ""]
    lines += table(["model", "rms fit [Nm]", "rms validation [Nm]", "verdict"], rows)
    units = {(one.joint, one.variable): one.unit for one in diagnosis.maps}
    places = [place for place in diagnosis.where if place.explained > NOTABLE_SHARE][:MAX_LOCATIONS]
    if places:
        lines += ["", "## Where the final model fails", ""]
    groups = [name for name, *_ in diagnosis.steps[-1].groups] if diagnosis.steps else []
    for place in places:
        share, unit = share_text(place.explained), units.get((place.joint, place.variable), "")
        span = as_markdown(span_text(place, unit, groups))
        lines.append(f"- {as_markdown(place.joint)} along {place.variable}: {share}, mostly {span}")
    notes = [note.text for note in diagnosis.notes if note.text not in verdict]
    notes += hints(diagnosis.parameters)
    return "\n".join([*lines, "", *(f"- {as_markdown(text)}" for text in notes)])


def _finding_lines(one: MergedFinding[Finding], rank: int) -> list[str]:
    (finding,) = one.members
    lines = [
        f"{rank}. **{as_markdown(one.statement())}**: confidence {confidence_range(one.members)}, "
        f"{removes_text(one)}"
    ]
    if finding.parameters:
        lines.append(f"   - {as_markdown(values_text(finding))}")
    lines += [f"   - {as_markdown(tie_text(tie))}" for tie in finding.inseparable_from]
    if finding.absorbed:
        named = absorbed_list(finding.absorbed, MAX_ABSORBED)
        lines.append(f"   - was absorbed by {as_markdown(named)}")
    return [*lines, ""]


def group_text(
    measurements: MeasurementSet, group: Group, motion: RobotMotion, stride: int, reason: str = ""
) -> str:
    """One group: its data, its simulated motion or the `reason` why there is none, the stride."""
    lines = [f"## {as_markdown(group_title(group))}", ""]
    if measurements.simulated:
        lines += [SIMULATED, ""]
    bodies = ", ".join(f"{body.mass:g} kg on {as_markdown(body.link)}" for body in group.bodies) or "nothing"
    lines += [
        f"- trajectory {as_markdown(group.trajectory)}, payload {as_markdown(group.payload)}: {bodies}",
        f"- {group.samples} samples in {len(group.segments)} segments, {group.duration:.3g} s",
        f"- used for {'validation only' if group.validation else 'fitting'}",
    ]
    if stride > 1:
        lines.append(f"- 1 of every {stride} samples is recorded (after filtering)")
    if reason:
        lines.append(f"- identified motion: not simulated: {as_markdown(reason)}")
    elif motion.model_theta is not None:
        error = np.max(np.abs(motion.model_theta - motion.theta))
        note = as_markdown(motion.model_note)
        lines.append(f"- identified motion: {note}; θ differs by {error:.2g} rad at most")
    return "\n".join(lines)


def group_title(group: Group) -> str:
    """The group's name; validation groups are marked."""
    return group.name + (" (validation)" if group.validation else "")


def _errors(rms: Sequence[float], held_out: Sequence[float] | None) -> list[str]:
    """Total rms of fit and validation [Nm] as table cells."""
    return [number(total_rms(rms), 4), "–" if held_out is None else number(total_rms(held_out), 4)]
