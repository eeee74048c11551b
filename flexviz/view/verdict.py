"""A diagnosis as HTML: the verdict, and each finding with its numbers, ties and absorbing parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flexviz.wording import (
    absorbed_text,
    escape,
    finding_name,
    plural,
    share_text,
    tie_text,
    values_text,
    verdict_text,
)

if TYPE_CHECKING:
    from flexviz.diagnosis import Diagnosis, Finding

LIKELY_CONFIDENCE = 0.5  # from which a finding stands out
NAMED_PARAMETERS = 3  # parameters named at most


def verdict_html(diagnosis: Diagnosis | None, up_to_date: bool = True) -> str:
    """The verdict in its box, with notes and warnings."""
    if diagnosis is None:
        return (
            '<div class="fv fv-dim">Is the model complete? <b>Find the missing effect</b> identifies it '
            "where that has not been done, examines the residual, and tries every known effect.</div>"
        )
    said = [note for note in diagnosis.notes if diagnosis.free_curve is None or note.kind != "free-curve"]
    notes = "".join(
        f'<div class="fv-dim">{escape(note.text[:1].upper() + note.text[1:])}.</div>' for note in said
    )
    if diagnosis.stopped:
        notes += '<div class="fv-warn">Stopped before the end: these are the findings so far.</div>'
    if not up_to_date:
        notes += (
            '<div class="fv-warn">The model or the groups have changed since: press Find the missing effect.'
            "</div>"
        )
    return (
        f'<div class="fv fv-verdict {escape(diagnosis.verdict)}">{escape(verdict_text(diagnosis))}</div>'
        + (f'<div class="fv">{notes}</div>' if notes else "")
    )


def heading_html(diagnosis: Diagnosis | None) -> str:
    """Heading of the findings where none of them is credible."""
    if diagnosis is None or diagnosis.verdict == "missing" or not diagnosis.findings:
        return ""
    return '<div class="fv fv-dim">Tried, but not credible explanations of the residual:</div>'


def finding_html(finding: Finding, rank: int, full: bool) -> str:
    """A finding: name, values, share, confidence; with `full` also its ties and what had absorbed it."""
    likely = " fv-likely" if finding.confidence >= LIKELY_CONFIDENCE else ""
    values = values_text(finding)
    lines = [f"<div><b>{rank}. {escape(finding_name(finding))}</b></div>"]
    lines.append(
        f'<div class="fv-bar"><span style="width:{100 * min(max(finding.confidence, 0.0), 1.0):.0f}%"></span>'
        f"</div><div>confidence {share_text(finding.confidence)}, explains {share_text(finding.score)}</div>"
    )
    if values:
        lines.append(f"<div>{escape(values)}</div>")
    ties = finding.inseparable_from if full else finding.inseparable_from[:1]
    lines += [f'<div class="fv-warn">{escape(tie_text(tie))}</div>' for tie in ties]
    absorbed = getattr(finding, "absorbed", ()) if full else ()
    if absorbed:
        named = "; ".join(absorbed_text(entry) for entry in absorbed[:NAMED_PARAMETERS])
        more = len(absorbed) - NAMED_PARAMETERS
        named += f"; and {plural(more, 'other')}" if more > 0 else ""
        lines.append(f'<div class="fv-dim">Had been absorbed by {escape(named)}.</div>')
    return f'<div class="fv fv-finding{likely}">{"".join(lines)}</div>'
