"""One recorded signal of one joint, as a log has it."""

from __future__ import annotations

from dataclasses import dataclass

from flexviz.base.arrays import Array, Bools, Indices


@dataclass(frozen=True, eq=False)
class Channel:
    """One recorded signal of one joint.

    Attributes:
        signal: "theta", "tau" or an optional one.
        joint: its name.
        time: (N,) [s] after the log's first sample, increasing.
        values: (N,) in the unit of the column.
        size: one such unit in SI, positive.
        incomplete: (N,) whether the sample's row lacks another signal; None: none does.
        rows: (N,) of the log, from 0; None: all of them.
    """

    signal: str
    joint: str
    time: Array
    values: Array
    size: float = 1.0
    incomplete: Bools | None = None
    rows: Indices | None = None

    def row(self, seconds: float) -> int:
        """The row of the log at this instant, from 1."""
        at = int(self.time.searchsorted(seconds - 1e-9))
        return (at if self.rows is None else int(self.rows[at])) + 1
