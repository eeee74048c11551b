"""Several recordings of one robot: which findings and values come back in all of them, and which do not."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexviz.base._scipy import sp
from flexviz.content.records import ParameterEstimate
from flexviz.model.effects import EFFECT_FAMILIES, family_of
from flexviz.outlets.batch.rows import DONE, FleetRow
from flexviz.outlets.batch.thresholds import THRESHOLDS


@dataclass(frozen=True)
class RepeatedFinding:
    """An effect that the diagnosis added in some recordings.

    Attributes:
        text: "coulomb_friction:joint2".
        family: that it stands for where a recording does not tell its members apart; "" otherwise.
        count, of: in how many recordings, of how many diagnosed ones.
        absent: the sets without it.
    """

    text: str
    family: str
    count: int
    of: int
    absent: tuple[str, ...]

    @property
    def everywhere(self) -> bool:
        """Whether all recordings have it."""
        return self.count == self.of


@dataclass(frozen=True)
class RepeatedValue:
    """A parameter over the recordings that determine it.

    Attributes:
        parameter, unit: "stiffness:joint1", "Nm/rad".
        count, of: recordings that determine it, of how many.
        mean: weighted by the standard errors where all are known.
        spread: standard deviation between the recordings.
        stated: rms of the standard errors; NaN where one is unknown.
        ratio: √(χ²/(n − 1)) of the values about their weighted mean: spread in units of the stated errors.
        probability: of a χ² this large if the stated errors were right; NaN where they are unknown.
        holds: whether the spread is what the stated errors allow, judged with all values of the robot.
    """

    parameter: str
    unit: str
    count: int
    of: int
    mean: float
    spread: float
    stated: float
    ratio: float
    probability: float
    holds: bool

    @property
    def relative(self) -> float:
        """The spread relative to the mean."""
        return self.spread / abs(self.mean) if self.mean else math.inf

    @property
    def everywhere(self) -> bool:
        """Whether all recordings determine it."""
        return self.count == self.of


@dataclass(frozen=True)
class Repeatability:
    """What the recordings of one robot have in common; findings and values, those that come back first."""

    robot: str
    recordings: int
    findings: tuple[RepeatedFinding, ...]
    values: tuple[RepeatedValue, ...]


def repeatability(rows: Sequence[FleetRow]) -> list[Repeatability]:
    """Each robot with at least `FleetThresholds.least_recordings` finished sets."""
    of: dict[str, list[FleetRow]] = defaultdict(list)
    for row in rows:
        if row.state == DONE:
            of[row.robot].append(row)
    enough = {robot: sets for robot, sets in of.items() if len(sets) >= THRESHOLDS.least_recordings}
    return [
        Repeatability(robot, len(sets), repeated_findings(sets), repeated_values(sets))
        for robot, sets in enough.items()
    ]


def repeated_findings(rows: Sequence[FleetRow]) -> tuple[RepeatedFinding, ...]:
    """The effects added in diagnosed recordings of one robot, the most frequent first.

    Where one recording finds only a family on a joint, the members that others find there count as the same.
    """
    diagnosed = [row for row in rows if row.verdict]
    tied = {(_place(text), family) for row in diagnosed for text, family in row.named if family}

    def same(text: str) -> tuple[str, str]:
        family = family_of(text.partition(":")[0]) or ""
        return (_place(text), family) if (_place(text), family) in tied else (text, "")

    found = [{same(text) for text in row.found} for row in diagnosed]
    out = []
    for key in dict.fromkeys(key for one in found for key in sorted(one)):
        place, family = key
        name = f"{EFFECT_FAMILIES[family][0]}:{place}" if family else place
        absent = tuple(row.set for row, one in zip(diagnosed, found, strict=True) if key not in one)
        count = len(diagnosed) - len(absent)
        out.append(RepeatedFinding(name, family, count, len(diagnosed), absent))
    return tuple(sorted(out, key=lambda one: -one.count))


def _place(text: str) -> str:
    return text.partition(":")[2]


def repeated_values(rows: Sequence[FleetRow]) -> tuple[RepeatedValue, ...]:
    """The spread of each parameter between recordings of one robot against the stated standard errors."""
    known: dict[str, list[ParameterEstimate]] = defaultdict(list)
    for row in rows:
        for label, value in row.parameters.items():
            known[label] += [value] if value.identifiable != "no" and math.isfinite(value.value) else []
    judged = {label: _scatter(values) for label, values in known.items() if len(values) > 1}
    tests = sum(math.isfinite(one[-1]) for one in judged.values())
    out = []
    for label, (mean, spread, stated, ratio, probability) in judged.items():
        values = known[label]
        holds = not probability * tests < THRESHOLDS.false_alarms  # True for NaN
        out.append(
            RepeatedValue(
                label, values[0].unit, len(values), len(rows), mean, spread, stated, ratio, probability, holds
            )
        )
    single = [(label, values[0]) for label, values in known.items() if len(values) == 1]
    nan = math.nan
    for label, one in single:
        out.append(RepeatedValue(label, one.unit, 1, len(rows), one.value, nan, one.std, nan, nan, True))
    return tuple(sorted(out, key=lambda one: (-one.count, not one.holds)))


def _scatter(values: Sequence[ParameterEstimate]) -> tuple[float, float, float, float, float]:
    """Mean, spread, stated standard error, √(χ²/(n − 1)) and its probability; of two or more values."""
    value = np.array([one.value for one in values])
    std = np.array([one.std or math.nan for one in values])
    spread = float(np.std(value, ddof=1))
    if not np.isfinite(std).all():
        return float(value.mean()), spread, math.nan, math.nan, math.nan
    weight = std**-2
    mean = float(weight @ value / weight.sum())
    freedom = len(value) - 1
    chi2 = float(np.sum(((value - mean) / std) ** 2))
    probability = float(sp.special.chdtrc(freedom, chi2))
    return mean, spread, float(np.sqrt(np.mean(std**2))), math.sqrt(chi2 / freedom), probability
