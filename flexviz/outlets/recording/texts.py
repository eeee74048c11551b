"""The texts of a recording, as Markdown."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexviz.analysis.diagnosis import Diagnosis
from flexviz.analysis.identification import Identification
from flexviz.content.records import JointErrors
from flexviz.content.rendering import markdown_fragment
from flexviz.content.scene import RobotMotion
from flexviz.content.wording import (
    as_markdown,
    effect_text_name,
    error_whole,
    markdown_table,
    mounting_text,
    verdict_text,
)
from flexviz.data.measurements import Group, MeasurementSet
from flexviz.outlets.recording.optimiser import Solve

SIMULATED = "**Simulated data**: a simulator wrote this measurement set, no robot was recorded."


def about_text(measurements: MeasurementSet, solves: Sequence[Solve], diagnoses: Sequence[Diagnosis]) -> str:
    """The set, every finished result with its error, the last verdict."""
    lines = [f"# {as_markdown(measurements.name)}", ""]
    if measurements.simulated:
        lines += [SIMULATED, ""]
    lines += [
        f"- robot: {as_markdown(measurements.robot.name)}, {measurements.n} joints",
        *([f"- mounting: {mounted}"] if (mounted := mounting_text(measurements.robot.gravity)) else []),
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
            _told(result.residual.rms, result),
            _told(result.residual.rms_validation, result),
        ]
        for solve in solves
        if (result := solve.result) is not None
    ]
    if not rows:
        return "\n".join([*lines, "Nothing is identified yet."])
    header = ["", "model", "observer", "error, fitted groups", "error, held-out groups"]
    return "\n".join([*lines, *markdown_table(header, rows)])


def _told(rms: Sequence[float] | None, result: Identification) -> str:
    of = result.residual
    return error_whole(JointErrors(rms, of.torque_spread, (), of.units)) if rms else "–"


def result_text(result: Identification, count: int, label: str) -> str:
    """One result: model, parameters, error per joint, observer."""
    effects = ", ".join(effect_text_name(effect.text) for effect in result.model.effects)
    refined = ", refined" if result.refined else ""
    title = f"# Result {count}{f': {as_markdown(label)}' if label else ''}{refined}"
    named = f"effects in the model: {as_markdown(effects) or 'none'}"
    return "\n\n".join([title, named, markdown_fragment(result.document().blocks())])


def diagnosis_text(diagnosis: Diagnosis) -> str:
    """The verdict, the ranked findings, the staircase, where the model fails, notes."""
    return markdown_fragment(diagnosis.document().blocks())


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
