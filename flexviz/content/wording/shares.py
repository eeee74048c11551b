"""How much of the error each added effect removes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from flexviz.content.records import FoundEffect
from flexviz.content.wording.errors import normalised
from flexviz.content.wording.records import DiagnosisLike, ErrorsLike

FindingKey = tuple[str, float | None]


def step_shares(steps: Sequence[ErrorsLike], spread: Sequence[float]) -> list[float]:
    """Share of the first model's error that each later model removes; all together at most 1.

    With E_k the mean over the joints of (rms / torque spread)² of model k, on the held-out groups where all
    models have them, model k removes (E_{k−1} − E_k) / E_0. One that raises the error removes nothing; the
    others then share what remains, (E_0 − E_last) / E_0, in proportion.

    Args:
        steps: the models, the first without any of the effects.
        spread: standard deviation of each joint's torque, shape (n,) [Nm]; empty: rms is compared in Nm.

    Returns:
        one share per model; that of the first is 0.
    """
    if not steps:
        return []
    held_out = all(step.rms_validation for step in steps)
    errors = [_mean_square((step.rms_validation if held_out else step.rms) or (), spread) for step in steps]
    gains = [max(before - after, 0.0) for before, after in pairwise(errors)]
    removed = max(errors[0] - errors[-1], 0.0)
    if not removed > 0:
        return [0.0] * len(steps)
    return [0.0, *(gain / sum(gains) * removed / errors[0] for gain in gains)]


def _mean_square(rms: Sequence[float], spread: Sequence[float]) -> float:
    values = [v for v in (normalised(rms, spread) if spread else rms) if math.isfinite(v)]
    return sum(v**2 for v in values) / len(values) if values else 0.0


def found_shares(result: DiagnosisLike) -> dict[FindingKey, float]:
    """The known shares of the error that the findings of a diagnosis remove, by `finding_key`.

    The steps tell them; without steps those are known that the findings carry.
    """
    known = {finding_key(one): one.share for one in result.findings if one.share is not None}
    if len(result.steps) > 1:
        for step, share in zip(result.steps, step_shares(result.steps, result.torque_spread), strict=True):
            if step.added is not None:
                known[finding_key(step.added)] = share
    return known


def finding_key(finding: FoundEffect) -> FindingKey:
    """What tells a finding from one of the same effect that was only tried."""
    return finding.text, finding.confidence
