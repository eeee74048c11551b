"""What texts read of a result: records of an identification or a diagnosis, and entries of documents."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol


class Placed(Protocol):
    """A parameter or an effect of a joint, a payload or a group, or of the whole robot."""

    @property
    def joint(self) -> str | None: ...
    @property
    def payload(self) -> str | None: ...
    @property
    def group(self) -> str | None: ...


class ValueLike(Protocol):
    """A value with its standard error."""

    @property
    def value(self) -> float: ...
    @property
    def std(self) -> float | None: ...
    @property
    def unit(self) -> str: ...


class ParameterLike(Placed, ValueLike, Protocol):
    """A parameter of a result, which may be held at a bound."""

    @property
    def name(self) -> str: ...
    @property
    def start(self) -> float | None: ...
    @property
    def at_bound(self) -> bool: ...


class FamilyLike(Protocol):
    """Effects whose signatures are alike."""

    @property
    def name(self) -> str: ...
    @property
    def tied(self) -> bool: ...
    @property
    def members(self) -> Sequence[str]: ...
    @property
    def confidence(self) -> float: ...


class TieLike(Protocol):
    """An effect that the data hardly tell from another."""

    @property
    def effect(self) -> str: ...
    @property
    def joint(self) -> str | None: ...
    @property
    def correlation(self) -> float: ...
    @property
    def breaks(self) -> str: ...


class AbsorbedLike(Protocol):
    """A parameter that moved when an effect was added."""

    @property
    def name(self) -> str: ...
    @property
    def joint(self) -> str | None: ...
    @property
    def before(self) -> float: ...
    @property
    def after(self) -> float: ...
    @property
    def unit(self) -> str: ...
    @property
    def deviations(self) -> float: ...


class NamedLike(Placed, Protocol):
    """An effect that was found, or the place where it stands in a document."""

    @property
    def effect(self) -> str: ...
    @property
    def text(self) -> str: ...
    @property
    def confidence(self) -> float | None: ...
    @property
    def family(self) -> FamilyLike | None: ...
    @property
    def share(self) -> float | None: ...
    @property
    def absorbed(self) -> Sequence[AbsorbedLike]: ...


class FindingLike(NamedLike, Protocol):
    """A candidate of a diagnosis or of a results document."""

    @property
    def score(self) -> float: ...
    @property
    def confidence(self) -> float: ...
    @property
    def parameters(self) -> Mapping[str, ValueLike]: ...


class ErrorsLike(Protocol):
    """Errors of a model per joint [Nm]."""

    @property
    def rms(self) -> Sequence[float]: ...
    @property
    def rms_validation(self) -> Sequence[float] | None: ...
    @property
    def noise_floor(self) -> Sequence[float]: ...


class StepLike(ErrorsLike, Protocol):
    """A model on the way, the effect that it adds, and its errors."""

    @property
    def added(self) -> NamedLike | None: ...


class LocationLike(Protocol):
    """A joint and a variable with a structured residual, and the range where it is largest."""

    @property
    def joint(self) -> str: ...
    @property
    def variable(self) -> str: ...
    @property
    def explained(self) -> float: ...
    @property
    def range(self) -> Sequence[float]: ...


class NoteLike(Protocol):
    """A remark on a diagnosis."""

    @property
    def kind(self) -> str: ...
    @property
    def text(self) -> str: ...


class MoveLike(Protocol):
    """A move of a search, as tried."""

    @property
    def kind(self) -> str: ...
    @property
    def added(self) -> Sequence[str]: ...
    @property
    def removed(self) -> Sequence[str]: ...
    @property
    def delta(self) -> float: ...
    @property
    def error(self) -> float: ...
    @property
    def accepted(self) -> bool: ...
    @property
    def resolution(self) -> str: ...
    @property
    def why(self) -> str: ...


class DiagnosisLike(Protocol):
    """A diagnosis or a results document."""

    @property
    def verdict(self) -> str | None: ...
    @property
    def findings(self) -> Sequence[FindingLike]: ...
    @property
    def steps(self) -> Sequence[StepLike]: ...
    @property
    def torque_spread(self) -> Sequence[float]: ...
    @property
    def where(self) -> Sequence[LocationLike]: ...
    @property
    def typed_notes(self) -> Sequence[NoteLike]: ...
