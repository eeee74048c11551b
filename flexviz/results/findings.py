"""What is said of an effect that was found: ties, absorbed parameters, its family."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass

from flexviz.results.base import RECORD, Number, Real


@dataclass(frozen=True, config=RECORD)
class Tie:
    """An effect that the data hardly distinguish from the one found.

    Attributes:
        correlation: of the two signatures, after projecting out the model's own parameters.
        breaks: sentence naming the motion or payload in which the two differ most; may be empty.
    """

    effect: str
    joint: str | None
    correlation: Number
    breaks: Annotated[str, Field(alias="would_separate")] = ""


@dataclass(frozen=True, config=RECORD)
class Absorbed:
    """A parameter that absorbed the missing effect and changed when the effect was added.

    Attributes:
        before, after: value [unit].
        deviations: change in standard errors.
    """

    name: str
    joint: str | None
    before: Number
    after: Number
    unit: str
    deviations: Real


@dataclass(frozen=True, config=RECORD)
class Family:
    """Effects whose signatures the data cannot separate (`flexviz.effects.EFFECT_FAMILIES`).

    Attributes:
        tied: whether the members tie in these data; the family is then the finding.
        members: names of the effects, the simplest first.
        confidence: probability that one of the members is correct.
    """

    name: str
    tied: bool
    members: tuple[str, ...]
    confidence: Number
