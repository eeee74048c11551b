"""What measurement sets are asked from above; given by the package's face: checks stand above data."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar


class SetChecks:
    """Called with a measurement set.

    Attributes:
        refuse: follows `read_set` and `from_arrays`; may raise an InputError.
        seen_limits: limits at which its torques stand.
    """

    refuse: ClassVar[Callable[[Any], None]]
    seen_limits: ClassVar[Callable[[Any], tuple[Any, ...]]]
