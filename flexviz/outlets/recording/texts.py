"""The texts of a recording, as Markdown."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexviz.analysis.diagnosis import Diagnosis
from flexviz.analysis.identification import Identification
from flexviz.content.blocks import Callout, Items, Paragraph, table
from flexviz.content.records import JointErrors
from flexviz.content.rendering import markdown_fragment
from flexviz.content.scene import RobotMotion
from flexviz.content.topics import SIMULATED, set_rows
from flexviz.content.wording import as_markdown, effect_text_name, error_whole, verdict_text
from flexviz.data.measurements import Group, MeasurementSet
from flexviz.outlets.recording.optimiser import Solve


def about_text(measurements: MeasurementSet, solves: Sequence[Solve], diagnoses: Sequence[Diagnosis]) -> str:
    """The set, every finished result with its error, the last verdict."""
    rows = [
        [
            str(solve.number),
            solve.label or "the set's own model",
            f"{result.observer_name}, {result.observer_entry.tuning}",
            _told(result.residual.rms, result),
            _told(result.residual.rms_validation, result),
        ]
        for solve in solves
        if (result := solve.result) is not None
    ]
    head = ("", "model", "observer", "error, fitted groups", "error, held-out groups")
    groups = ["Groups", ", ".join(map(group_title, measurements.groups))]
    drawn = ["3D", "both robots by their motor angles θ; the identified one is simulated"]
    content = [
        *([Paragraph(SIMULATED)] if measurements.simulated else []),
        table(("", ""), [*set_rows(measurements), groups, drawn]),
        *(Callout(verdict_text(one), "") for one in diagnoses[-1:]),
        table(head, rows) if rows else Paragraph("Nothing is identified yet."),
    ]
    return f"# {as_markdown(measurements.name)}\n\n{markdown_fragment(content)}"


def _told(rms: Sequence[float] | None, result: Identification) -> str:
    of = result.residual
    return error_whole(JointErrors(rms, of.torque_spread, (), of.units)) if rms else "–"


def result_text(result: Identification, count: int, label: str) -> str:
    """One result: model, parameters, error per joint, observer."""
    effects = ", ".join(effect_text_name(effect.text) for effect in result.model.effects)
    refined = ", refined" if result.refined else ""
    title = as_markdown(f"Result {count}{f': {label}' if label else ''}{refined}")
    named = Paragraph(f"effects in the model: {effects or 'none'}")
    return f"# {title}\n\n{markdown_fragment([named, *result.document().blocks()])}"


def diagnosis_text(diagnosis: Diagnosis) -> str:
    """The verdict, the ranked findings, the staircase, where the model fails, notes."""
    return markdown_fragment(diagnosis.document().blocks())


def group_text(
    measurements: MeasurementSet, group: Group, motion: RobotMotion, stride: int, reason: str = ""
) -> str:
    """One group: its data, its simulated motion or the `reason` why there is none, the stride."""
    bodies = ", ".join(f"{body.mass:g} kg on {body.link}" for body in group.bodies) or "nothing"
    lines = [
        f"trajectory {group.trajectory}, payload {group.payload}: {bodies}",
        f"{group.samples} samples in {len(group.segments)} segments, {group.duration:.3g} s",
        f"used for {'validation only' if group.validation else 'fitting'}",
    ]
    if stride > 1:
        lines.append(f"1 of every {stride} samples is recorded (after filtering)")
    if reason:
        lines.append(f"identified motion: not simulated: {reason}")
    elif motion.model_theta is not None:
        error = np.max(np.abs(motion.model_theta - motion.theta))
        lines.append(f"identified motion: {motion.model_note}; θ differs by {error:.2g} rad at most")
    simulated = [Paragraph(SIMULATED)] if measurements.simulated else []
    return f"## {as_markdown(group_title(group))}\n\n{markdown_fragment([*simulated, Items(lines)])}"


def group_title(group: Group) -> str:
    """The group's name; validation groups are marked."""
    return group.name + (" (validation)" if group.validation else "")
