"""The error of a model per joint, against the noise: what every table of errors has."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial

from flexviz.content.blocks import Block, TableBlock, table
from flexviz.content.records import FOLLOWING, ErrorsLike, JointErrors, ResidualSummary, percent_of
from flexviz.content.results import ResultDocument
from flexviz.content.topics.topic import Topic, register
from flexviz.content.wording import error_in_torque, error_short, explained

Column = Callable[[int | None], str]
"""The text of a joint, by its index; None: of all joints."""


class Errors(Topic):
    """Of one fit; the errors of a diagnosis stand in its staircase."""

    name = "errors"
    title = "The error"

    def blocks(self, result: ResultDocument) -> Iterator[Block]:
        if result.verdict is None and result.residual is not None:
            yield fit_table(result.residual)


register(Errors())


def fit_table(residual: ResidualSummary) -> TableBlock:
    """Rms error of each joint on the fitted and on the held-out groups."""
    rows = {"fit": residual.rms, "held out": residual.rms_validation}
    errors = {
        name: JointErrors(row, residual.torque_spread, residual.noise_floor, residual.units)
        for name, row in rows.items()
        if row is not None
    }
    columns = {name: partial(share_of, one) for name, one in errors.items()}
    columns |= further_columns(residual, list(errors.values())[-1])
    of = percent_of(residual.units).replace("%", "per cent")
    unit = f", in {of}'s standard deviation" if residual.torque_spread else ""
    return error_table(residual.joints, columns, f"Rms residual of each joint{unit}")


def further_columns(of: ErrorsLike, errors: JointErrors) -> dict[str, Column]:
    """What every table of errors adds of its last model. A further number of a model belongs here.

    Args:
        of: the model, with all that is known of its errors.
        errors: those that the table states.
    """
    mark, what = errors.mark, "motion" if errors.percent == FOLLOWING else "torque"
    return {
        f"{what} explained": lambda j: "" if j is None else explained(errors.shares[j] / 100),
        "noise": lambda j: "–" if mark is None else share_of(mark, j),
    }


def share_of(errors: JointErrors, joint: int | None) -> str:
    """ "7.51 % (51.3 mNm)"."""
    text = error_short(errors, joint)
    return f"{text} ({error_in_torque(errors, joint)})" if errors.relative else text


def error_table(
    joints: Sequence[str], columns: Mapping[str, Column], caption: str, mean: bool = False
) -> TableBlock:
    """A row per joint, and one of all joints if their `mean` is stated."""
    places = [*enumerate(joints), *([(None, "mean")] if mean else [])]
    rows = [[name, *(text(j) for text in columns.values())] for j, name in places]
    return table(("joint", *columns), rows, range(1, len(columns) + 1), caption)
