"""What was left out of a log while it was read."""

from __future__ import annotations

from flexviz.base.facts import Fact
from flexviz.content.wording.facts import says


@says("row-ends")
def row_ends(fact: Fact) -> str:
    """Empty fields after the separators with which rows end."""
    if (count := fact.values["empty"]) > 1:
        return f"each row ends with {count} separators: the empty fields after them are left out"
    return "each row ends with a separator: the empty field after it is left out"


@says("cut-off")
def cut_off(fact: Fact) -> str:
    """What a power cut left at the end of a file."""
    zeros, found = fact.values["zeros"], fact.values["record"]
    if not zeros:
        return f"the last line is cut off ({found}) and left out"
    told = f"the file ends with {zeros} zeros, as after a power cut: they are left out"
    return f"{told}, and the line before them ({found})" if found else told
