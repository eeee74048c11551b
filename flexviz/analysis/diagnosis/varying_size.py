"""Whether the size of an effect is the same throughout the recordings, and at every load.

A clamp that works loose looks like backlash, and a constant backlash explains most of it; a stiffness that
varies with the angle looks like a transmission error, whose amplitude would have to follow the load. The
score test of a size that changes linearly with the time of each recording, or with the torque that its joint
transmits, shows the difference: the law is not the library's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.fine import Fine, FineModel
from flexviz.analysis.diagnosis.thresholds import THRESHOLDS
from flexviz.analysis.estimation import explained
from flexviz.content.wording import plain_name, unit_text
from flexviz.model.effects import EFFECTS, ChosenEffect, ParameterSpec

Array = NDArray[np.float64]

LIMITS = THRESHOLDS.evidence

ALONG: tuple[Literal["time", "load"], ...] = ("time", "load")


@dataclass(frozen=True)
class ChangingSize:
    """A size p of an effect that changes.

    Attributes:
        named: the effect's name, joint, group and payload, as of a `Finding`.
        along: "time" of each recording, or "load" of the joint.
        start, end: about p at the start and at the end of a recording, or at low and high load, in its unit.
    """

    named: tuple[str, str | None, str | None, str | None]
    size: ParameterSpec
    along: Literal["time", "load"]
    start: float
    end: float

    @property
    def text(self) -> str:
        """The finding as a sentence."""
        effect, *places = self.named
        place = next((f" of {place}" for place in places if place), "")
        grows = "grows" if abs(self.end) > abs(self.start) else "falls"
        what = f"{plain_name(self.size.name)} of the {EFFECTS[effect].title.lower()}{place} is not constant"
        how = f"{'changes' if self.start * self.end < 0 else grows} from about {self.start:.2g} to"
        end = f"{self.end:.2g} {unit_text(self.size.unit)}".rstrip()
        when = "during a recording" if self.along == "time" else "with the torque that the joint transmits"
        return f"{what}: it {how} {end} {when}, which this effect cannot describe"


def changing_size(fine: Fine, model: FineModel) -> ChangingSize | None:
    """The size whose change explains most of what a model leaves; None if all are constant.

    The criterion judges the gain of a linear change, estimated in closed form, like that of any move.
    """
    fit, signals = model.fit, fine.context.two_band.narrow.signals
    sized = [(e, k, where.start + k) for e, where in fit.layout.effect_slices() for k in _sizes(e)]
    if not sized:
        return None
    z, projection = fit.point.z, fine.context.projection(fit)
    group, time = signals.group, np.zeros(signals.count)
    for k in np.unique(group):
        time[group == k] = _standardised(signals.time[group == k])
    best, found = 0.0, None
    for effect, k, column in sized:
        for along in ALONG if effect.joint is not None else ALONG[:1]:
            variable = time if along == "time" else _standardised(fit.point.torque[:, effect.joint])
            signature = (z[:, :, column] * variable[:, None]).reshape(-1, 1)
            (half,), gain = explained(*projection.normal(signature))
            share = fine.criterion.samples / fit.point.used.sum()
            rate = share.min() if effect.joint is None else share[effect.joint]
            nats = 0.5 * gain * float(rate) - fine.criterion.cost(1, 1)
            if nats < best or abs(half) <= LIMITS.changing_share * abs(fit.x[column]):
                continue
            middle = fit.x[column] - projection.share(signature)[column, 0] * half
            spec = EFFECTS[effect.effect].parameters[k]
            start, end = np.clip(middle + half * np.array([-1.0, 1.0]), spec.lower, spec.upper)
            named = (effect.effect, fit.layout.joint_name(effect), effect.group, effect.payload)
            if start != end:
                best, found = nats, ChangingSize(named, spec, along, float(start), float(end))
    return found


def _sizes(effect: ChosenEffect) -> tuple[int, ...]:
    """Indices of the parameters that are to be constant; not of episodes and free curves."""
    law = EFFECTS[effect.effect]
    return () if law.scope == "episode" or law.stopgap else law.size_at


def _standardised(values: Array) -> Array:
    """Values from −1 to 1 if they are evenly distributed."""
    return (values - values.mean()) / max(np.sqrt(3) * float(values.std()), 1e-300)
