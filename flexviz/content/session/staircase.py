"""A diagnosis that added effects as the states of an analysis, one per kind of effect."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from flexviz.analysis.diagnosis import Diagnosis
from flexviz.content.session.state import Analysis, ModelStep, Session
from flexviz.content.wording import finding_key, found_shares, text_runs, tied_families

OF_THE_FINAL_MODEL: dict[str, Any] = {
    "maps": (), "where": (), "free_curve": None, "guard": None, "parameters": (), "notes": (),
    "trace": (), "decoys": None, "limit": None,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class DiagnosedModel:
    """One model on the way.

    Attributes:
        label: of the action that led to it.
        effects: texts of the effects that it has more than the one before, one kind on several joints.
        diagnosis: its own; the next effects are the findings.
    """

    label: str
    effects: tuple[str, ...]
    diagnosis: Diagnosis


def diagnosed_models(diagnosis: Diagnosis, joints: Sequence[str]) -> list[DiagnosedModel]:
    """The set's own model, then one per kind of added effects; the last has the whole diagnosis."""
    steps = diagnosis.steps
    added = [[] if step.added is None else [step.added.text] for step in steps]
    families = tied_families(step.added for step in steps if step.added is not None)
    runs, shares = text_runs(added, joints, families), found_shares(diagnosis)
    ends = [last for _, _, last in runs]
    out = []
    for k, (name, texts, last) in enumerate(runs):
        following = steps[last + 1 : ends[k + 1] + 1] if k + 1 < len(runs) else ()
        found = [step.added for step in following if step.added is not None] if k else diagnosis.findings
        findings = tuple(replace(one, share=shares.get(finding_key(one))) for one in found)
        answer = replace(diagnosis, **OF_THE_FINAL_MODEL) if following else diagnosis
        answer = replace(answer, verdict=steps[last].verdict, findings=findings, steps=(steps[last],))
        out.append(DiagnosedModel(f"added {name}" if texts else "", tuple(texts), answer))
    return out


def model_chain(session: Session) -> list[tuple[ModelStep, Analysis | None]]:
    """The models of the present staircase and those beyond it, each with the last state that shows it."""
    states = [one.analysis for one in (*session.steps, *session.future)]
    now = _keys(session.analysis.model_steps)
    chains = [state.model_steps for state in states if now and _keys(state.model_steps)[: len(now)] == now]
    longest = max(chains, key=len, default=())
    out: list[tuple[ModelStep, Analysis | None]] = []
    for k, one in enumerate(longest):
        key = _keys(longest[: k + 1])
        shown = [state for state in states if _keys(state.model_steps) == key and state.diagnosis_up_to_date]
        out.append((one, shown[-1] if shown else None))
    return out


def _keys(steps: Sequence[ModelStep]) -> list[tuple[tuple[str, ...], tuple[float, ...]]]:
    """What tells models apart, also in a session that was read."""
    return [(one.effects, tuple(one.step.rms)) for one in steps]
