"""What a recording says in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexviz.measurements import Group, MeasurementSet
from flexviz.observers import Observer
from flexviz.view.motion import Motion
from flexviz.view.text import number

if TYPE_CHECKING:
    from flexviz.identification import Identification

SIMULATED = "**Simulated data**: a simulator wrote this measurement set, no robot was recorded."


def summary_text(measurements: MeasurementSet, result: Identification | None, observer: Observer) -> str:
    """The set and what was identified, as Markdown."""
    lines = [f"# {escaped(measurements.name)}", ""]
    if measurements.simulated:
        lines += [SIMULATED, ""]
    lines += [
        f"- robot: {escaped(measurements.robot.name)}, {measurements.n} joints",
        f"- observer of the plotted states: `{observer.name}`, {bandwidth_text(observer.bandwidth)}",
        f"- groups: {', '.join(escaped(group_title(group)) for group in measurements.groups)}",
        "- 3D: both robots by their motor angles θ; the identified one is simulated",
        "",
    ]
    if result is None:
        return "\n".join([*lines, "Nothing was identified for this recording."])
    used = f"`{result.observer_name}`, {bandwidth_text(result.bandwidth)}" + (
        ", refined" if result.refined else ""
    )
    lines += [
        f"## Identification: {'converged' if result.converged else 'not converged'}",
        "",
        f"{escaped(result.message)}",
        "",
        f"Observer {used}; condition number {number(result.condition_number, 3)}; {result.seconds:.2f} s.",
        "",
        "| parameter | joint | value | ± 95 % | unit | identifiable |",
        "|---|---|---|---|---|---|",
    ]
    for p in result.parameters:
        band = number(1.96 * p.std, 2) if np.isfinite(p.std) else "–"
        row = (p.name, p.joint or "", number(p.value, 6), band, p.unit, p.identifiable)
        lines.append("| " + " | ".join(escaped(cell) for cell in row) + " |")
    lines += ["", "| joint | rms fit [Nm] | rms validation [Nm] | noise floor [Nm] |", "|---|---|---|---|"]
    residual = result.residual
    for j, joint in enumerate(residual.joints):
        validation = "–" if residual.rms_validation is None else number(residual.rms_validation[j], 4)
        cells = (escaped(joint), number(residual.rms[j], 4), validation, number(residual.noise_floor[j], 4))
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def group_text(measurements: MeasurementSet, group: Group, motion: Motion, stride: int) -> str:
    """One group as Markdown: what it is, how its model was simulated, what was left out."""
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
    if motion.model_theta is not None:
        error = np.max(np.abs(motion.model_theta - motion.theta))
        lines.append(
            f"- identified motion: {escaped(motion.model_note)}; θ differs by {error:.2g} rad at most"
        )
    elif motion.model_note:
        lines.append(f"- identified motion: {escaped(motion.model_note)}")
    return "\n".join(lines)


def group_title(group: Group) -> str:
    """The group's name, and whether it is for validation."""
    return group.name + (" (validation)" if group.validation else "")


def bandwidth_text(bandwidth: float | np.ndarray) -> str:
    """One bandwidth, or one a joint, in rad/s."""
    return ", ".join(f"{value:.4g}" for value in np.atleast_1d(bandwidth)) + " rad/s"


def escaped(text: str) -> str:
    """Text that Markdown shows as it is."""
    return "".join("\\" + character if character in "\\`*_{}[]<>#|~" else character for character in text)
