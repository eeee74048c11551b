"""Numbers and comments in XML."""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike


def number_text(values: ArrayLike) -> str:
    """Numbers for an XML attribute, exact when read back; no −0."""
    return " ".join(repr(float(value) + 0.0) for value in np.ravel(np.asarray(values, dtype=float)))


def comment_text(lines: Iterable[str], indent: str = "") -> str:
    """The inside of an XML comment, which must not contain two hyphens in a row."""
    inside = [re.sub("-(?=-)", "- ", line).rstrip() for line in lines]
    joined = f"\n{indent}     ".join(inside)
    return f" {joined} "
