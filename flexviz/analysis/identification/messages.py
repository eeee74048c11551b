"""What the message of an identification adds: static tests, and groups that are not used."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexviz.analysis.identification.plain_fit import PlainFit
from flexviz.analysis.identification.result import Identification
from flexviz.content.wording import listed, plural
from flexviz.data.measurements import Group
from flexviz.robot.model import FlexibleModel

APART = 3.0  # standard errors of a static test, from which the motion contradicts it


def holds_text(plain: PlainFit, model: FlexibleModel) -> str:
    """What static tests added, and whose stiffness the motion pulls away from them; "" without any."""
    holds = plain.start.prior.holds
    if holds is None:
        return ""
    clamped = holds.clamped
    away = np.abs(1 / model.stiffness - clamped.value) * np.sqrt(clamped.precision)
    text = f"; with {plural(holds.count, 'hold')} of static tests"
    apart = [joint for joint, one in zip(model.joints, away, strict=True) if one > APART]
    if apart:
        text += f", whose stiffness of {listed(apart)} the motion contradicts: the model lacks something"
    return text


def left_out_text(result: Identification, groups: Sequence[Group]) -> str:
    """The groups that are not used; empty if all are."""
    used = (*result.groups, *result.validation_groups)
    names = [group.name for group in groups if group.name not in used]
    if not names:
        return ""
    text = (
        f"; {plural(len(names), 'group')} not used: {listed(names)}, gaps leave no stretch longer than the "
    )
    return f"{text}observer's transients"
