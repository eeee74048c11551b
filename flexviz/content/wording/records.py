"""What texts read of a result, whether it is a diagnosis or a results document."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from flexviz.content.records import CandidateEffect, DetectionLimit, Note, ResidualLocation, StepEntry


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
    def typed_notes(self) -> Sequence[Note]: ...
    @property
    def stopped(self) -> bool: ...
    @property
    def limit(self) -> DetectionLimit | None: ...
