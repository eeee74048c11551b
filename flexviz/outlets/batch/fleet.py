"""A fleet's parameters over dates and between robots: drift and outliers."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from flexviz.base.arrays import Array
from flexviz.content.records import ParameterEstimate
from flexviz.outlets.batch.rows import DONE, FleetRow
from flexviz.outlets.batch.thresholds import THRESHOLDS

DAY = 86400.0  # [s]
YEAR = 365.25  # [days]
MAD_TO_SPREAD = 1.4826  # of normal values


@dataclass(frozen=True, eq=False)
class ParameterHistory:
    """One parameter of one robot over its dated sets.

    Attributes:
        robot, parameter, unit: "robot7", "stiffness:joint1", "Nm/rad".
        rows: (N,) indices of the rows, in the order of their dates.
        days: (N,) since the first of them [days].
        first: its date, ISO 8601.
        value, std: (N,) in `unit`; std is NaN where unknown.
        slope, slope_std: per day; NaN with too few dates.
        offset: of the line at day 0.
        probability: of a slope this far from zero if nothing changes; NaN with too few dates.
        drifts: whether it is a drift, judged with all parameters of the fleet.
    """

    robot: str
    parameter: str
    unit: str
    rows: tuple[int, ...]
    days: Array
    first: str
    value: Array
    std: Array
    slope: float
    slope_std: float
    offset: float
    probability: float
    drifts: bool = False

    @property
    def change(self) -> float:
        """Change of the line over the recorded time, relative to the mean value."""
        mean = abs(float(np.mean(self.value)))
        return self.slope * float(np.ptp(self.days)) / mean if mean > 0 else math.nan


@dataclass(frozen=True)
class Outlier:
    """A value that stands out of its fleet.

    Attributes:
        row: index of its set.
        parameter, value, unit: what stands out.
        median: of the values that it is compared with.
        deviations: distance from it in units of the fleet's spread and its own standard error.
        of: number of those.
    """

    row: int
    parameter: str
    value: float
    unit: str
    median: float
    deviations: float
    of: int


def histories(rows: Sequence[FleetRow]) -> list[ParameterHistory]:
    """Every parameter of every robot over its dates; drifting ones first, by their significance."""
    found: dict[tuple[str, str], list[tuple[float, int, ParameterEstimate]]] = defaultdict(list)
    for index, row, label, value in _values(rows):
        if (when := row.when) is not None:
            found[row.robot, label].append((when.timestamp() / DAY, index, value))
    out = [_history(rows, *key, sorted(places, key=lambda p: p[:2])) for key, places in found.items()]
    judged = sum(math.isfinite(one.probability) for one in out)
    out = [_judged(one, judged) for one in out]
    return sorted(out, key=lambda one: (not one.drifts, -abs(_significance(one))))


def _significance(one: ParameterHistory) -> float:
    return one.slope / one.slope_std if one.slope_std > 0 else 0.0


def _judged(one: ParameterHistory, judged: int) -> ParameterHistory:
    certain = one.probability * judged < THRESHOLDS.false_alarms  # False for NaN
    return replace(one, drifts=bool(certain and abs(one.change) >= THRESHOLDS.least_drift))


def _history(
    rows: Sequence[FleetRow], robot: str, label: str, places: list[tuple[float, int, ParameterEstimate]]
) -> ParameterHistory:
    days = np.array([day for day, _, _ in places])
    value = np.array([v.value for _, _, v in places])
    std = np.array([math.nan if v.std <= 0 else v.std for _, _, v in places])
    days -= days[0]
    slope, slope_std, offset, probability = line(days, value, std)
    indices = tuple(index for _, index, _ in places)
    return ParameterHistory(
        robot, label, places[0][2].unit, indices, days, rows[indices[0]].date, value, std,
        slope, slope_std, offset, probability,
    )  # fmt: skip


def line(days: Array, value: Array, std: Array) -> tuple[float, float, float, float]:
    """Slope, its standard error, offset, and probability of such a slope if nothing changes.

    Weighted by the standard errors where all are known; where the values scatter more than these, the scatter
    decides.
    """
    n = len(days)
    if len(np.unique(days)) < THRESHOLDS.least_dates:
        return math.nan, math.nan, math.nan, math.nan
    sigma = std if np.isfinite(std).all() else np.ones(n)
    weighted = np.stack((days, np.ones(n)), axis=1) / sigma[:, None]
    covariance = np.linalg.inv(weighted.T @ weighted)
    slope, offset = covariance @ (weighted.T @ (value / sigma))
    chi2 = float(np.sum(((value - slope * days - offset) / sigma) ** 2)) / (n - 2)
    inflation = max(chi2, 1.0) if np.isfinite(std).all() else chi2
    slope_std = math.sqrt(covariance[0, 0] * inflation)
    if slope_std <= 0:
        return float(slope), slope_std, float(offset), math.nan
    return float(slope), slope_std, float(offset), float(2 * special.stdtr(n - 2, -abs(slope) / slope_std))


def outliers(rows: Sequence[FleetRow]) -> list[Outlier]:
    """Values far from the median of all robots with the same description, the farthest first.

    Each robot counts with its latest value, because its sets resemble one another; the sets of a single robot
    are compared with one another.
    """
    latest: dict[tuple[str, str], dict[str, tuple[int, ParameterEstimate]]] = defaultdict(dict)
    sets: dict[tuple[str, str], list[tuple[int, ParameterEstimate]]] = defaultdict(list)
    for index, row, label, value in sorted(_values(rows), key=lambda v: v[1].date):
        latest[row.description_sha256, label][row.robot] = index, value
        sets[row.description_sha256, label].append((index, value))
    fleets = {key: sets[key] if len(of) == 1 else list(of.values()) for key, of in latest.items()}
    large = {key: fleet for key, fleet in fleets.items() if len(fleet) >= THRESHOLDS.least_fleet}
    judged = sum(map(len, large.values()))
    out: list[Outlier] = []
    for (_, label), fleet in large.items():
        values = np.array([value.value for _, value in fleet])
        std = np.array([np.nan_to_num(value.std) for _, value in fleet])
        median = float(np.median(values))
        spread = MAD_TO_SPREAD * float(np.median(np.abs(values - median)))
        scale = np.hypot(spread, std)
        freedom = THRESHOLDS.robust_freedom * (len(fleet) - 1)
        limit = -float(special.stdtrit(freedom, THRESHOLDS.false_alarms / (2 * judged)))
        for (index, value), distance, width in zip(fleet, values - median, scale, strict=True):
            deviations = float(distance / width) if width > 0 else 0.0
            if abs(deviations) > limit:
                out.append(Outlier(index, label, value.value, value.unit, median, deviations, len(fleet)))
    return sorted(out, key=lambda one: -abs(one.deviations))


def _values(rows: Sequence[FleetRow]) -> Iterator[tuple[int, FleetRow, str, ParameterEstimate]]:
    """The values that the data determine, with the index of their row."""
    for index, row in enumerate(rows):
        if row.state == DONE:
            for label, value in row.parameters.items():
                if value.identifiable != "no" and math.isfinite(value.value):
                    yield index, row, label, value
