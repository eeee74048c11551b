"""An effect that was found: its place and values, ties, absorbed parameters, its family."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass

from flexviz.base.fields import RECORD, Number, Real, is_none
from flexviz.content.records.parameters import EffectParameter
from flexviz.model.effects import free_curve
from flexviz.robot.model import EffectValue


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
    """Effects whose signatures the data cannot separate (`flexviz.model.effects.EFFECT_FAMILIES`).

    Attributes:
        tied: whether the members tie in these data; the family is then the finding.
        members: names of the effects, the simplest first.
        confidence: probability that one of the members is correct.
    """

    name: str
    tied: bool
    members: tuple[str, ...]
    confidence: Number


@dataclass(frozen=True, eq=False, config=RECORD)
class FoundEffect:
    """An effect that was found, and where it acts.

    Attributes:
        effect, joint, group, payload: effect and location.
        confidence: probability that it is correct; NaN for a free curve in a document: it is not physics.
        inseparable_from: effects that the data cannot distinguish from it.
        absorbed: parameters that absorbed the effect before, the largest change first.
        family: the family of effects that it belongs to; None if it belongs to none.
        share: of the held-out mean squared error, relative to each joint's torque, that it removes in the
            order in which the effects are added (`flexviz.content.wording.step_shares`); None if unknown.
    """

    effect: str
    joint: str | None
    group: str | None = None
    payload: str | None = None
    confidence: Real = math.nan
    inseparable_from: tuple[Tie, ...] = ()
    absorbed: tuple[Absorbed, ...] = ()
    family: Annotated[Family | None, Field(exclude_if=is_none)] = None
    share: Annotated[Number | None, Field(exclude_if=is_none)] = None

    @property
    def text(self) -> str:
        """Name on the command line: `name:joint`, `name:payload`, `name:joint@group`."""
        return EffectValue(self.effect, self.joint, {}, self.group, self.payload).text

    @property
    def stopgap(self) -> bool:
        """Whether it is a free curve: not physics."""
        return free_curve(self.effect) is not None


@dataclass(frozen=True, eq=False, kw_only=True, config=RECORD)
class CandidateEffect(FoundEffect):
    """A candidate for the missing effect.

    Attributes:
        score: share of the excess held-out variance removed after refitting.
        parameters: name → value, standard error and unit.
    """

    confidence: Real = Field(kw_only=True)  # documents have to state it
    score: Number
    parameters: dict[str, EffectParameter]
