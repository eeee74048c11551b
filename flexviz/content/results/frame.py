"""Parameters as a table of pandas."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from flexviz.base.errors import require_package
from flexviz.base.statistics import NORMAL_95
from flexviz.content.records import ParameterEstimate

DataFrame = Any
"""A `pandas.DataFrame`; pandas need not be installed."""

COLUMNS = ("name", "joint", "payload", "group", "value", "std", "unit", "start", "identifiable", "at_bound")


def parameter_frame(parameters: Iterable[ParameterEstimate]) -> DataFrame:
    """One row per parameter, in SI units, with the ends `low` and `high` of its 95 % interval.

    Raises:
        MissingPackage: pandas is not installed.
    """
    require_package("pandas", "a table of pandas", "pandas")
    import pandas

    parameters = list(parameters)
    columns = {name: [getattr(one, name, None) for one in parameters] for name in COLUMNS}
    frame = pandas.DataFrame(columns)
    half = NORMAL_95 * frame["std"].astype(float)
    frame.insert(6, "low", frame["value"] - half)
    frame.insert(7, "high", frame["value"] + half)
    return frame
