"""What changes with the observer's bandwidth, which is observer error."""

from __future__ import annotations

import numpy as np

from flexviz.analysis.diagnosis import BandwidthCheck, ParameterCurve
from flexviz.content import blocks
from flexviz.content.topics.story import Story
from flexviz.content.topics.topic import Topic, register
from flexviz.content.wording import number, plain_name, unit_text

MAX_PARAMETERS = 40  # listed


class Bandwidth(Topic):
    """A check that a diagnosis makes on request; its remarks are notes of the diagnosis."""

    name = "bandwidth"
    title = "What moves with the observer's bandwidth"

    def section(self, story: Story) -> blocks.Section | None:
        found = None if story.diagnosis is None else story.diagnosis.guard
        return None if found is None else _section(self.title, found)


register(Bandwidth())


def _section(title: str, found: BandwidthCheck) -> blocks.Section:
    low, high = number(found.bandwidths[0], 3), number(found.bandwidths[-1], 3)
    holds = "Nothing changes: residuals and parameters stay within their uncertainty."
    return blocks.section(
        title,
        blocks.explanation(
            f"The same model was fitted with the observer ({found.observer}) at {len(found.bandwidths)} "
            f"bandwidths from {low} to {high} rad/s. Changes with the bandwidth are observer error, not "
            "physics of the robot."
        ),
        None if any(found.facts()) else blocks.Paragraph(holds),
        _residuals(found),
        _at_bandwidths(found) if found.parameters else None,
    )


def _residuals(found: BandwidthCheck) -> blocks.TableBlock:
    rows = []
    for j, joint in enumerate(found.joints):
        moves = bool(found.observer_error[j])
        rows.append(
            [
                joint,
                number(found.rms[found.in_use, j], 3),
                number(np.nanmax(found.change[:, j]), 3),
                number(found.noise_floor[j], 3),
                blocks.Cell("part is observer error" if moves else "holds", strong=moves),
            ]
        )
    head = ("joint", "residual [Nm]", "largest change [Nm]", "noise explains [Nm]", "verdict")
    caption = f"Residuals at fixed parameters, compared below {number(found.band, 3)} rad/s"
    return blocks.table(head, rows, (1, 2, 3), caption)


def _at_bandwidths(found: BandwidthCheck) -> blocks.TableBlock:
    order = sorted(found.parameters, key=lambda p: (p.trusted, -p.moved))
    rows = []
    for p in order[:MAX_PARAMETERS]:
        rows.append(
            [
                p.name if p.joint is None and ":" in p.name else plain_name(p.name),  # or a combination
                ", ".join(part for part in (p.joint, p.place) if part) or "–",
                number(p.values[found.in_use]),
                *_span(p),
                unit_text(p.unit),
                number(p.moved, 2),
                blocks.Cell("trusted" if p.trusted else "not to be trusted", strong=not p.trusted),
            ]
        )
    head = ("parameter", "joint", "in use", "least", "largest", "unit", "moves by (std. errors)", "verdict")
    more = len(order) - MAX_PARAMETERS
    others = f"; {more} more that do not change" if more > 0 else ""
    return blocks.table(head, rows, (2, 3, 4, 6), f"Parameters fitted at each bandwidth{others}", dense=True)


def _span(p: ParameterCurve) -> tuple[str, str]:
    values = p.values[np.isfinite(p.values)]
    return (number(values.min()), number(values.max())) if values.size else ("–", "–")
