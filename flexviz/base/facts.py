"""What a computation has found, in numbers; `flexviz.content.wording` has the sentences, for every outlet."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Literal

Severity = Literal["wrong", "odd", "note"]
"""Of what must be mended, of what looks unusual, and of what is only to be known."""

Scalar = str | bool | int | float | None
if TYPE_CHECKING:
    Value = Any  # the sentence of a kind knows which value is which
else:
    Value = Scalar | tuple[Scalar, ...] | tuple[tuple[Scalar, ...], ...]  # what a session keeps


@dataclass(frozen=True)
class Remedy:
    """The key that mends a fault, and the value to give it.

    Attributes:
        key: with its tables, "model.no_torque".
        value: as TOML has it.
        of: where the key belongs: to measurements.toml of a "set", or in an import's mapping to a signal, a
            log, or all of it.
    """

    key: str
    value: Value
    of: Literal["set", "signal", "log", "mapping"] = "signal"


@dataclass(frozen=True)
class Fact:
    """One finding: what it is about, and its numbers.

    `str(fact)` and `fact.text` are its sentence, in the words of `flexviz.content.wording` for its kind.

    Attributes:
        kind: what was found, "few_samples"; each has one sentence.
        severity: whether it must be mended, looks unusual, or is only to be known.
        joints, groups, columns: names of what it is about.
        rows: first row, and the row after the last.
        file: that it was found in.
        values: numbers in SI units and names, under the names that the sentence of this kind uses.
        remedy: what mends it; None if nothing is known to.
    """

    kind: str
    severity: Severity = "note"
    joints: tuple[str, ...] = ()
    groups: tuple[str, ...] = ()
    columns: tuple[str, ...] = ()
    rows: tuple[int, int] | None = None
    file: str = ""
    values: Mapping[str, Value] = field(default_factory=dict, hash=False)
    remedy: Remedy | None = None

    words: ClassVar[Callable[[Fact], str]] = repr
    """Turns a fact into its sentence; given by the package's face, because words stand above facts."""

    @property
    def text(self) -> str:
        """Its sentence."""
        return type(self).words(self)

    def __str__(self) -> str:
        return self.text
