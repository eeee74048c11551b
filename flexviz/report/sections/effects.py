"""Which effects: what was added and what was considered, ranked, with the evidence."""

from __future__ import annotations

import numpy as np

from flexviz.charts import COLOURS, thin
from flexviz.diagnosis import Evidence, Finding
from flexviz.effects import EFFECTS
from flexviz.report.blocks import Block, Cell, Figure, Section, Table, table, text
from flexviz.report.chart import Chart, Curve
from flexviz.report.gathering import Subject
from flexviz.wording import (
    absorbed_text,
    effect_text_name,
    finding_name,
    number,
    plural,
    share_text,
    values_text,
)

RESIDUAL_COLOUR = "#0072B2"
POINTS = 500  # of a drawn line
TAKEN_UP = 3  # parameters named at most
REAL = 3.0  # standard errors by which a parameter must have moved to be named
CONSIDERED = 6  # candidates listed a round


def effects(subject: Subject) -> Section | None:
    """A part for each effect that was added or is proposed, and the ranking; None before any diagnosis."""
    if subject.diagnosis is None:
        return None
    parts = [_added(name, finding) for name, finding in subject.added]
    proposed = subject.diagnosis.findings if subject.diagnosis.verdict == "missing" else ()
    parts += [_part(f"Proposed: {finding_name(f)}", f) for f in proposed[:1]]
    blocks: list[Block] = []
    if not parts:
        blocks.append(text("No effect was added and none is proposed."))
    ranking = _ranking(subject)
    if ranking is not None:
        blocks += [
            text(
                "What was tried on each model, the best first. A candidate “explains” the share of the error "
                "above the noise, on held-out data, that it takes away after refitting.",
                quiet=True,
            ),
            ranking,
        ]
    return Section("Which effects", tuple(blocks), tuple(parts))


def _added(name: str, finding: Finding | None) -> Section:
    if finding is None:
        return Section(
            f"Added: {effect_text_name(name)}", (text("Chosen by hand, or found in a lost step."),)
        )
    return _part(f"Added: {finding_name(finding)}", finding)


def _part(title: str, finding: Finding) -> Section:
    blocks: list[Block] = [
        text(
            f"{values_text(finding)}. " if finding.parameters else "",
            f"Explains {share_text(finding.score)} of the held-out error above the noise; confidence "
            f"{share_text(finding.confidence)}.",
        )
    ]
    effect = EFFECTS.get(finding.effect)
    if effect is not None:
        blocks.append(text(f"{effect.explanation} Law: {effect.equation}. ", effect.signature, quiet=True))
    moved = [a for a in finding.absorbed if abs(a.deviations) >= REAL]
    if moved:
        named = "; ".join(absorbed_text(entry) for entry in moved[:TAKEN_UP])
        more = len(moved) - TAKEN_UP
        also = f"; and {plural(more, 'other')}" if more > 0 else ""
        blocks.append(text(f"Until it was added other parameters had taken it up: {named}{also}."))
    if finding.evidence is not None and len(finding.evidence.time) > 1:
        blocks.append(Figure(evidence_chart(finding, finding.evidence)))
    return Section(title, tuple(blocks))


def evidence_chart(finding: Finding, evidence: Evidence) -> Chart:
    """The residual with what the effect takes away, in the group where that is largest."""
    group, first, last = max(
        evidence.groups,
        key=lambda g: float(np.mean(evidence.signature[g[1] : g[2]] ** 2)) if g[2] > g[1] else 0.0,
    )
    rows = slice(first, last)
    x, (residual, signature) = thin(
        np.asarray(evidence.time[rows]),
        [np.asarray(evidence.residual[rows]), np.asarray(evidence.signature[rows])],
        POINTS,
    )
    before, after = (
        float(np.sqrt(np.mean(values**2)))
        for values in (evidence.residual[rows], evidence.residual[rows] - evidence.signature[rows])
    )
    words = (
        f"Group {group}: the residual of {evidence.joint} before adding the effect ({number(before, 3)} Nm "
        f"rms) and what the effect takes from it; {number(after, 3)} Nm rms stay."
    )
    return Chart(
        f"Evidence for {finding_name(finding)}",
        words,
        f"time in group {group} [s]",
        f"torque on {evidence.joint} [Nm]",
        (
            Curve(x, residual, "residual without the effect", RESIDUAL_COLOUR, "", 2.6),
            Curve(x, signature, "what the effect takes away", COLOURS.model, "6 3", 1.8),
        ),
    )


def _ranking(subject: Subject) -> Table | None:
    chosen = {name for name, _ in subject.added}
    rows: list[list[str | Cell]] = []
    for index, round_ in enumerate(subject.rounds):
        found = round_.diagnosis.findings if round_.diagnosis is not None else ()
        for rank, finding in enumerate(found[:CONSIDERED], 1):
            added = finding.text in chosen and rank == 1
            rows.append(
                [
                    f"model {index}",
                    str(rank),
                    Cell(finding_name(finding), strong=added),
                    values_text(finding),
                    share_text(finding.score),
                    share_text(finding.confidence),
                    "added" if added else "",
                ]
            )
    if not rows:
        return None
    head = ("tried on", "rank", "effect", "value ± 95 %", "explains", "confidence", "")
    return table(head, rows, (1, 4, 5), "Candidates")
