"""Effects added and candidates ranked, with the evidence."""

from __future__ import annotations

from flexviz.diagnosis import Finding
from flexviz.effects import EFFECTS
from flexviz.report.blocks import FIGURE_HEIGHT, Block, Cell, Paragraph, ReportTable, Section, table
from flexviz.report.content import ReportContent
from flexviz.view import evidence_chart
from flexviz.wording import absorbed_list, effect_text_name, finding_name, share_text, values_text

MIN_DEVIATIONS = 3.0  # [standard errors] a parameter must have changed by to count as absorbing an effect
MAX_CANDIDATES = 6  # listed per model


def effects(content: ReportContent) -> Section | None:
    """One part per added or proposed effect, and the ranking; None without a diagnosis."""
    if content.diagnosis is None:
        return None
    parts = [_added(name, finding) for name, finding in content.added]
    proposed = content.diagnosis.findings if content.diagnosis.verdict == "missing" else ()
    parts += [_part(f"Proposed: {finding_name(f)}", f) for f in proposed[:1]]
    blocks: list[Block] = []
    if not parts:
        blocks.append(Paragraph("No effect was added and none is proposed."))
    ranking = _ranking(content)
    if ranking is not None:
        blocks += [
            Paragraph(
                "Candidates tried on each model, best first. A candidate “explains” the share of the "
                "held-out error above the noise that it removes after refitting.",
                quiet=True,
            ),
            ranking,
        ]
    return Section("Which effects", tuple(blocks), tuple(parts))


def _added(name: str, finding: Finding | None) -> Section:
    if finding is None:
        return Section(
            f"Added: {effect_text_name(name)}",
            (Paragraph("Added by hand, or by a diagnosis that is not in the session any more."),),
        )
    return _part(f"Added: {finding_name(finding)}", finding)


def _part(title: str, finding: Finding) -> Section:
    blocks: list[Block] = [
        Paragraph(
            (f"{values_text(finding)}. " if finding.parameters else "")
            + f"Explains {share_text(finding.score)} of the held-out error above the noise; confidence "
            f"{share_text(finding.confidence)}.",
        )
    ]
    effect = EFFECTS.get(finding.effect)
    if effect is not None:
        words = f"{effect.explanation} Law: {effect.equation}. {effect.signature}"
        blocks.append(Paragraph(words, quiet=True))
    moved = [a for a in finding.absorbed if abs(a.deviations) >= MIN_DEVIATIONS]
    if moved:
        blocks.append(
            Paragraph(f"Before it was added, other parameters absorbed it: {absorbed_list(moved)}.")
        )
    chart = evidence_chart(finding, height=FIGURE_HEIGHT)
    if chart.series:
        blocks.append(chart)
    return Section(title, tuple(blocks))


def _ranking(content: ReportContent) -> ReportTable | None:
    chosen = {name for name, _ in content.added}
    rows: list[list[str | Cell]] = []
    for index, one in enumerate(content.rounds):
        found = one.diagnosis.findings if one.diagnosis is not None else ()
        for rank, finding in enumerate(found[:MAX_CANDIDATES], 1):
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
