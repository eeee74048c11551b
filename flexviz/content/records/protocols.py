"""What is read of a result, whether it is a diagnosis or a results document."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from flexviz.content.records.curves import ResidualLocation
from flexviz.content.records.entries import StepEntry
from flexviz.content.records.findings import CandidateEffect
from flexviz.content.records.notes import DetectionLimit


class ErrorsLike(Protocol):
    """Errors of a model per joint, in `units`; in Nm without."""

    @property
    def rms(self) -> Sequence[float]: ...
    @property
    def rms_validation(self) -> Sequence[float] | None: ...
    @property
    def noise_floor(self) -> Sequence[float]: ...
    @property
    def units(self) -> Sequence[str]: ...


class NoteLike(Protocol):
    """A fact, or a note of a document."""

    @property
    def kind(self) -> str: ...
    @property
    def text(self) -> str: ...


class DiagnosisLike(Protocol):
    """A diagnosis or a results document."""

    @property
    def verdict(self) -> str | None: ...
    @property
    def findings(self) -> Sequence[CandidateEffect]: ...
    @property
    def steps(self) -> Sequence[StepEntry]: ...
    @property
    def torque_spread(self) -> Sequence[float]: ...
    @property
    def where(self) -> Sequence[ResidualLocation]: ...
    @property
    def typed_notes(self) -> Sequence[NoteLike]: ...
    @property
    def stopped(self) -> bool: ...
    @property
    def limit(self) -> DetectionLimit | None: ...
