"""Results that can be shown; what is said of them stands above them, in `flexviz.content.topics`."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, ClassVar


class Shown:
    """Something that content speaks of."""

    blocks: ClassVar[Callable[[Any], Iterable[Any]]]
    """All that is said of it, as `flexviz.content.blocks`; given by the package's face."""
