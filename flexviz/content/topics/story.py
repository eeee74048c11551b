"""What led to the present model, gathered from a session: what reports tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from flexviz.analysis.acceptance import AcceptanceLimits
from flexviz.analysis.diagnosis import Diagnosis, Finding, PredictionErrors
from flexviz.analysis.diagnosis import Step as DiagnosisStep
from flexviz.analysis.identification import Identification
from flexviz.content.records import ParameterEstimate, found_shares, step_shares
from flexviz.content.results import ResultDocument
from flexviz.content.session import Analysis, ModelStep, Session, diagnosed_models, identified_errors
from flexviz.content.wording import MergedFinding, merged_findings, merged_texts, text_runs
from flexviz.data.measurements import Fingerprint, MeasurementSet, fingerprint
from flexviz.robot.model import FlexibleModel


@dataclass(frozen=True, eq=False)
class DiagnosisRound:
    """A diagnosed model, its diagnosis if that is still kept, and the effects added since the last one."""

    model: ModelStep
    diagnosis: Diagnosis | None
    added: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class ComparedModel:
    """A model that is drawn: "before", "after" or "model", and its effects besides those of the set."""

    name: str
    model: FlexibleModel
    effects: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Story:
    """Everything that a report shows.

    Attributes:
        folder: of the saved session; None if it is not saved.
        fingerprint: of the set's files, when they were read.
        rounds: the diagnoses that led to the present model, in order.
        diagnosis, identification: of the present model; None if missing or out of date.
        changed: files of the set that have changed since the results were computed.
        identified: errors of the identification; empty with a diagnosis or without an identification.
        limits: those that the result is to keep, if there are any.
    """

    measurements: MeasurementSet
    session: Session
    folder: Path | None
    fingerprint: Fingerprint
    rounds: tuple[DiagnosisRound, ...]
    diagnosis: Diagnosis | None
    identification: Identification | None
    changed: tuple[str, ...] = ()
    identified: tuple[PredictionErrors, ...] = ()
    limits: AcceptanceLimits | None = None

    @property
    def analysis(self) -> Analysis:
        """The present state."""
        return self.session.analysis

    @property
    def joints(self) -> tuple[str, ...]:
        """The set's joints."""
        return self.measurements.joints

    @property
    def steps(self) -> tuple[DiagnosisStep, ...]:
        """The errors of each model."""
        return tuple(one.model.step for one in self.rounds)

    @property
    def runs(self) -> list[tuple[str, list[str], int]]:
        """The models as they are shown: neighbouring effects of one kind are one step; see `text_runs`."""
        return text_runs([one.added for one in self.rounds], self.joints, self.families)

    @property
    def families(self) -> dict[str, str]:
        """The families of those added effects that stand for one, by their texts."""
        return dict(pair for one in self.rounds for pair in one.model.families)

    @property
    def shares(self) -> dict[str, float]:
        """Share of the error of each added effect; those of one kind, added together, have equal parts."""
        each = zip(self.rounds, step_shares(self.steps, self.spread), strict=True)
        alike = (
            (one.added, share)
            for one, share in each
            if len(merged_texts(one.added, self.joints, self.families)) == 1
        )
        return {text: share / len(texts) for texts, share in alike for text in texts}

    @property
    def shown(self) -> tuple[DiagnosisStep, ...]:
        """The errors of the models as they are shown."""
        return tuple(self.rounds[last].model.step for _, _, last in self.runs)

    @property
    def spread(self) -> tuple[float, ...]:
        """Standard deviation of each joint's torque [Nm]."""
        return self.measurements.torque_spread

    @property
    def added(self) -> tuple[tuple[str, Finding | None], ...]:
        """Text and finding of each added effect; the finding is None if it was added by hand."""
        out: list[tuple[str, Finding | None]] = []
        for before, after in zip(self.rounds, self.rounds[1:], strict=False):
            found = before.diagnosis.findings if before.diagnosis else ()
            out += [(text, next((f for f in found if f.text == text), None)) for text in after.added]
        return tuple(out)

    @property
    def found(self) -> list[Finding]:
        """The added effects that a diagnosis found."""
        return [finding for _, finding in self.added if finding is not None]

    def share_of(self, texts: Sequence[str]) -> float | None:
        """Share of the error that added effects remove together; None if one of theirs is unknown."""
        shares = self.shares
        return sum(shares[text] for text in texts) if all(text in shares for text in texts) else None

    @property
    def proposed(self) -> MergedFinding[Finding] | None:
        """The effect that the diagnosis proposes, on all joints where it is found."""
        diagnosis = self.diagnosis
        if diagnosis is None or diagnosis.verdict != "missing" or not diagnosis.findings:
            return None
        return merged_findings(diagnosis.findings, found_shares(diagnosis))[0]

    @property
    def compared(self) -> list[ComparedModel]:
        """The first and the present model, or the identified one; those that are known."""
        rounds = [*self.rounds[:1], *self.rounds[1:][-1:]]
        names = ("before", "after") if len(rounds) > 1 else ("model",)
        if not rounds and self.identification is not None:
            return [ComparedModel("model", self.identification.model, tuple(self.analysis.effects))]
        return [
            ComparedModel(name, one.model.step.model, one.model.effects)
            for name, one in zip(names, rounds, strict=False)
            if one.model.step.model is not None
        ]

    @cached_property
    def document(self) -> ResultDocument | None:
        """The result of the present model, the diagnosis before the identification; None without any."""
        found = self.diagnosis or self.identification
        return None if found is None else found.document()

    @property
    def shown_group(self) -> str | None:
        """The longest held-out group, else the longest fitted one."""
        roles = dict(self.analysis.roles)
        groups = [group for group in self.measurements.groups if roles.get(group.name) != "ignore"]
        held_out = [group for group in groups if roles.get(group.name) == "validate"]
        longest = max(held_out or groups, key=lambda group: group.duration, default=None)
        return None if longest is None else longest.name

    @property
    def parameters(self) -> tuple[ParameterEstimate, ...]:
        """Parameters of the present model, from the identification if there is one, else the diagnosis."""
        source = self.identification or self.diagnosis
        return source.parameters if source is not None else ()


def shown_time(when: str) -> str:
    """An ISO time as readable text."""
    return when.replace("T", " ").replace("+00:00", " UTC")


def gather(
    session: Session,
    measurements: MeasurementSet,
    folder: Path | None = None,
    changed: tuple[str, ...] = (),
    limits: AcceptanceLimits | None = None,
) -> Story:
    """The report's content from a session."""
    analysis = session.analysis
    current = analysis.diagnosis_up_to_date or (bool(changed) and analysis.diagnosis is not None)
    fitted = analysis.up_to_date or bool(changed)
    errors = None if current or not fitted else identified_errors(measurements, analysis)
    return Story(
        measurements,
        session,
        folder,
        fingerprint(measurements),
        _rounds(session, analysis) if current else (),
        analysis.diagnosis if current else None,
        analysis.identification if fitted else None,
        changed,
        () if errors is None else (errors,),
        limits,
    )


def _rounds(session: Session, analysis: Analysis) -> tuple[DiagnosisRound, ...]:
    """The models that led to the present one, each with its diagnosis."""
    known = [step.analysis.diagnosis for step in session.steps if step.analysis.diagnosis is not None]
    rounds: list[DiagnosisRound] = []
    before: set[str] = set()
    for step in analysis.model_steps:
        source = next((d for d in known if d.steps and d.steps[0] is step.step), None)
        added = tuple(text for text in step.effects if text not in before)
        rounds.append(DiagnosisRound(step, source, added if rounds else ()))
        before |= set(step.effects)
    return tuple(rounds)


def diagnosed_session(measurements: MeasurementSet, diagnosis: Diagnosis) -> Session:
    """The session that diagnosing a set in the app would give, with one state per kind of effect."""
    session = Session.of(measurements)
    analysis = session.analysis
    for model in diagnosed_models(diagnosis, measurements.joints):
        analysis = analysis.with_effects(model.effects).with_diagnosis(model.diagnosis)
        session = session.then(model.label or "looked for the missing effect", analysis)
    return session
