"""Large arrays of which only those asked for last are kept."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable
from typing import Any, ClassVar, Generic, TypeVar
from weakref import ref

T = TypeVar("T")


class Recent(Generic[T]):
    """A large part of a point, made when it is asked for.

    A search keeps hundreds of points but looks at few of them. Of each kind only the last ones made are kept;
    others are made again if they are asked for.

    Args:
        kind: name of the part.
        kept: how many of the kind are kept.
    """

    _made: ClassVar[defaultdict[str, deque[ref[Recent[Any]]]]] = defaultdict(deque)

    def __init__(self, kind: str, kept: int) -> None:
        self._kind, self._kept = kind, kept
        self._part: T | None = None

    def get(self, make: Callable[[], T]) -> T:
        """The part, made if it is not kept."""
        part = self._part
        if part is None:
            part = self._part = make()
            made = self._made[self._kind]
            made.append(ref(self))
            while len(made) > self._kept:
                if (oldest := made.popleft()()) is not None:
                    oldest._part = None
        return part
