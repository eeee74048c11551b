"""A diagnosis as HTML: verdict and findings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flexviz.wording import (
    absorbed_list,
    escape,
    finding_name,
    share_text,
    tie_text,
    values_text,
    verdict_text,
)

if TYPE_CHECKING:
    from flexviz.diagnosis import Diagnosis, Finding

LIKELY_CONFIDENCE = 0.5  # a finding with at least this is highlighted


def verdict_html(diagnosis: Diagnosis | None, up_to_date: bool = True) -> str:
    """The verdict in its box, with notes and warnings."""
    if diagnosis is None:
        return (
            '<div class="fv fv-dim">Is the model complete? <b>Find the missing effect</b> identifies it if '
            "necessary, examines the residual, and tries every known effect.</div>"
        )
    shown = [note for note in diagnosis.notes if diagnosis.free_curve is None or note.kind != "free-curve"]
    notes = "".join(
        f'<div class="fv-dim">{escape(note.text[:1].upper() + note.text[1:])}.</div>' for note in shown
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
    """The heading above findings of which none is credible."""
    if diagnosis is None or diagnosis.verdict == "missing" or not diagnosis.findings:
        return ""
    return '<div class="fv fv-dim">Tried, but not credible explanations of the residual:</div>'


def finding_html(finding: Finding, rank: int, full: bool) -> str:
    """A finding: name, values, share, confidence; with `full` also all ties and absorbing parameters."""
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
    if full and finding.absorbed:
        named = escape(absorbed_list(finding.absorbed))
        lines.append(f'<div class="fv-dim">Was absorbed by other parameters: {named}.</div>')
    return f'<div class="fv fv-finding{likely}">{"".join(lines)}</div>'
