"""The error of an identification per joint, fitted and held out, against the noise."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from flexviz.base.units import unit_of_all
from flexviz.content.blocks import Block, TableBlock, table
from flexviz.content.records import PERCENT, JointErrors, ResidualSummary
from flexviz.content.results import ResultDocument
from flexviz.content.topics.topic import Topic, register
from flexviz.content.wording import number


class Errors(Topic):
    """Of one fit; the errors of a diagnosis stand in its staircase."""

    name = "errors"
    title = "The error"

    def blocks(self, result: ResultDocument) -> Iterator[Block]:
        if result.verdict is None and result.residual is not None:
            yield error_table(result.residual)


register(Errors())


def error_table(residual: ResidualSummary) -> TableBlock:
    """Rms error of each joint, and what the sensors alone would leave: of the torque, and in Nm."""
    rows = {"fit": residual.rms, "held out": residual.rms_validation, "noise": residual.noise_floor}
    rows = {name: row for name, row in rows.items() if row is not None}
    columns: dict[str, Sequence[float]] = {}
    if residual.torque_spread:
        columns = {
            f"{name} [%]": JointErrors(row, residual.torque_spread).shares for name, row in rows.items()
        }
    torque = unit_of_all(residual.units)
    columns |= {f"{name} [{torque}]": row for name, row in rows.items()}
    mixed = len(set(residual.units)) > 1
    body = [
        [joint, *(number(column[j]) for column in columns.values()), *([residual.units[j]] if mixed else [])]
        for j, joint in enumerate(residual.joints)
    ]
    measure = f"in {PERCENT} (its standard deviation) and " if residual.torque_spread else "in "
    caption = f"error: rms residual {measure}{torque.replace(', ', ' and ')}"
    head = ("joint", *columns, *(["unit"] if mixed else []))
    return table(head, body, range(1, len(columns) + 1), caption)
