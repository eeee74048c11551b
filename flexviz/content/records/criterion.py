"""The numbers of the criterion by which a diagnosis compares models."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import model_validator
from pydantic.dataclasses import dataclass

from flexviz.base.fields import RECORD, Number, check_lengths

Resolution = Literal["coarse", "fine"]
"""In the band of the motion, or in units of the sensors' noise."""


@dataclass(frozen=True, config=RECORD)
class CriterionNumbers:
    """The numbers of J, which a diagnosis lowers, as it stood where the search ended.

    J = Σ_j samples_j · log max(σ_j, least_j) + parameter_cost · parameters + effect_cost · effects, in nats;
    σ_j is what a model leaves of joint j's recorded torque.

    Attributes:
        resolution: "coarse" or "fine".
        joints: names of the n joints.
        samples: (n,) effective samples: independent ones of what a model leaves.
        least: (n,) error below which nothing counts: "coarse" in Nm, "fine" in standard deviations of the
            sensors' noise.
        parameter_cost, effect_cost: of each parameter, and of each effect besides its parameters [nats].
    """

    resolution: Resolution
    joints: tuple[str, ...]
    samples: tuple[Number, ...]
    least: tuple[Number, ...]
    parameter_cost: Number
    effect_cost: Number

    @model_validator(mode="after")
    def _per_joint(self) -> Self:
        check_lengths(len(self.joints), "one per joint", samples=self.samples, least=self.least)
        return self
