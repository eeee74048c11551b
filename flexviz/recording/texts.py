"""What a recording says in words, as Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from flexviz.measurements import Group, MeasurementSet
from flexviz.observers import Observer
from flexviz.scene import RobotMotion
from flexviz.statistics import NORMAL_95
from flexviz.view import total_rms
from flexviz.wording import (
    absorbed_text,
    finding_name,
    number,
    share_text,
    tie_text,
    values_text,
    verdict_text,
)

if TYPE_CHECKING:
    from flexviz.diagnosis import Diagnosis, Finding
    from flexviz.identification import Identification

SIMULATED = "**Simulated data**: a simulator wrote this measurement set, no robot was recorded."
FINDINGS = 8  # listed at most
Done = tuple[int, str, "Identification"]  # number, label, result


def about_text(measurements: MeasurementSet, done: Sequence[Done], diagnoses: Sequence[Diagnosis]) -> str:
    """The set, every result with its error, the last verdict."""
    lines = [f"# {escaped(measurements.name)}", ""]
    if measurements.simulated:
        lines += [SIMULATED, ""]
    lines += [
        f"- robot: {escaped(measurements.robot.name)}, {measurements.n} joints",
        f"- groups: {', '.join(escaped(group_title(group)) for group in measurements.groups)}",
        "- 3D: both robots by their motor angles θ; the identified one is simulated",
        "",
    ]
    if diagnoses:
        lines += [f"**{escaped(verdict(diagnoses[-1]))}**", ""]
    if not done:
        return "\n".join([*lines, "Nothing is identified yet."])
    lines += ["| | model | observer | rms fit [Nm] | rms validation [Nm] |", "|---|---|---|---|---|"]
    for count, label, result in done:
        held_out = result.residual.rms_validation
        cells = (
            str(count),
            escaped(label or "the set's own model"),
            f"{result.observer_name}, {bandwidth_text(result.bandwidth)}",
            number(total_rms(np.asarray(result.residual.rms)), 4),
            "–" if held_out is None else number(total_rms(np.asarray(held_out)), 4),
        )
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def result_text(result: Identification, count: int, label: str) -> str:
    """What was identified."""
    used = f"`{result.observer_name}`, {bandwidth_text(result.bandwidth)}" + (
        ", refined" if result.refined else ""
    )
    effects = ", ".join(f"{e.effect}{f' on {e.joint}' if e.joint else ''}" for e in result.model.effects)
    lines = [
        f"# Result {count}{f': {escaped(label)}' if label else ''}",
        "",
        f"{'Converged' if result.converged else 'Not converged'}: {escaped(result.message)}",
        "",
        f"- effects in the model: {escaped(effects) or 'none'}",
        f"- observer {used}",
        f"- fitted: {escaped(', '.join(result.groups))}; held out: "
        f"{escaped(', '.join(result.validation_groups)) or 'nothing'}",
        f"- condition number {number(result.condition_number, 3)}; {result.seconds:.2f} s",
        "",
        "| parameter | joint | value | ± 95 % | unit | identifiable |",
        "|---|---|---|---|---|---|",
    ]
    for p in result.parameters:
        band = number(NORMAL_95 * p.std, 2) if np.isfinite(p.std) else "–"
        row = (p.name, p.joint or "", number(p.value, 6), band, p.unit, p.identifiable)
        lines.append("| " + " | ".join(escaped(cell) for cell in row) + " |")
    lines += ["", "| joint | rms fit [Nm] | rms validation [Nm] | noise floor [Nm] |", "|---|---|---|---|"]
    residual = result.residual
    for j, joint in enumerate(residual.joints):
        validation = "–" if residual.rms_validation is None else number(residual.rms_validation[j], 4)
        cells = (escaped(joint), number(residual.rms[j], 4), validation, number(residual.noise_floor[j], 4))
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def verdict(diagnosis: Diagnosis) -> str:
    """The verdict in one sentence."""
    return verdict_text(diagnosis)


def diagnosis_text(diagnosis: Diagnosis) -> str:
    """The verdict, the ranked findings, the staircase, and what else a reader should know."""
    lines = [f"# {escaped(verdict(diagnosis))}", ""]
    if diagnosis.stopped:
        lines += ["**Stopped before the end**: this is what was found until then.", ""]
    for rank, finding in enumerate(diagnosis.findings[:FINDINGS], 1):
        lines += _finding_lines(finding, rank)
    more = len(diagnosis.findings) - FINDINGS
    if more > 0:
        lines += [f"And {more} less likely.", ""]
    lines += ["## Errors step by step", ""]
    lines += ["| model | rms fit [Nm] | rms validation [Nm] | then |", "|---|---|---|---|"]
    for step in diagnosis.steps:
        held_out = step.rms_validation
        cells = (
            "the model as it is" if step.added is None else f"+ {escaped(finding_name(step.added))}",
            number(total_rms(np.asarray(step.rms)), 4),
            "–" if held_out is None else number(total_rms(np.asarray(held_out)), 4),
            step.verdict,
        )
        lines.append("| " + " | ".join(cells) + " |")
    places = [place for place in diagnosis.where if place.explained > 0.01][:6]
    if places:
        lines += ["", "## Where the final model fails", ""]
        for place in places:
            low, high = (number(value, 3) for value in place.range)
            share = share_text(place.explained)
            lines.append(f"- {escaped(place.joint)} along {place.variable}: {share}, mostly {low} … {high}")
    lines += ["", *(f"- {escaped(note.text)}" for note in diagnosis.notes)]
    return "\n".join(lines)


def _finding_lines(finding: Finding, rank: int) -> list[str]:
    lines = [
        f"{rank}. **{escaped(finding_name(finding))}**: confidence {share_text(finding.confidence)}, "
        f"explains {share_text(finding.score)} of the error above the noise"
    ]
    if finding.parameters:
        lines.append(f"   - {escaped(values_text(finding))}")
    lines += [f"   - {escaped(tie_text(tie))}" for tie in finding.inseparable_from]
    if finding.absorbed:
        named = "; ".join(absorbed_text(entry) for entry in finding.absorbed[:4])
        lines.append(f"   - had been taken up by {escaped(named)}")
    return [*lines, ""]


def group_text(
    measurements: MeasurementSet, group: Group, motion: RobotMotion, stride: int, reason: str = ""
) -> str:
    """One group: what it is, how its model was simulated (or, `reason`, why not), what was left out."""
    lines = [f"## {escaped(group_title(group))}", ""]
    if measurements.simulated:
        lines += [SIMULATED, ""]
    bodies = ", ".join(f"{body.mass:g} kg on {escaped(body.link)}" for body in group.bodies) or "nothing"
    lines += [
        f"- trajectory {escaped(group.trajectory)}, payload {escaped(group.payload)}: {bodies}",
        f"- {group.samples} samples in {len(group.segments)} segments, {group.duration:.3g} s",
        f"- for {'validation, never fitted' if group.validation else 'fitting'}",
    ]
    if stride > 1:
        lines.append(f"- every {stride}th sample is recorded here (after filtering)")
    if reason:
        lines.append(f"- identified motion: none: {escaped(reason)}")
    elif motion.model_theta is not None:
        error = np.max(np.abs(motion.model_theta - motion.theta))
        lines.append(
            f"- identified motion: {escaped(motion.model_note)}; θ differs by {error:.2g} rad at most"
        )
    return "\n".join(lines)


def group_title(group: Group) -> str:
    """The group's name, and whether it is for validation."""
    return group.name + (" (validation)" if group.validation else "")


def observer_title(observer: Observer) -> str:
    """The observer's name and bandwidth."""
    return f"{observer.name}, {bandwidth_text(observer.bandwidth)}"


def bandwidth_text(bandwidth: float | np.ndarray) -> str:
    """One bandwidth, or one a joint, in rad/s."""
    return ", ".join(f"{value:.4g}" for value in np.atleast_1d(bandwidth)) + " rad/s"


def escaped(text: str) -> str:
    """Text that Markdown shows as it is."""
    return "".join("\\" + character if character in "\\`*_{}[]<>#|~" else character for character in text)
