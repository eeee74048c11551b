"""Large parts of which only those made last are kept."""

from __future__ import annotations

import math
from collections import defaultdict, deque
from collections.abc import Callable
from typing import Any, ClassVar, Generic, TypeVar
from weakref import ref

T = TypeVar("T")


class Recent(Generic[T]):
    """A large part of a point or of a cache, made when it is asked for.

    A search keeps hundreds of points but looks at few of them. Of each kind only the last ones made are kept;
    others are made again if they are asked for.

    Args:
        kind: name of the part.
        kept: how many of the kind are kept.
        size: of a part [bytes]; needed for `most`.
        most: bytes of the kind that are kept, though at least one part.
    """

    _made: ClassVar[defaultdict[str, deque[tuple[ref[Recent[Any]], int]]]] = defaultdict(deque)

    def __init__(
        self, kind: str, kept: int, size: Callable[[T], int] = lambda _: 0, most: float = math.inf
    ) -> None:
        self._kind, self._kept, self._size, self._most = kind, kept, size, most
        self._part: T | None = None

    def get(self, make: Callable[[], T]) -> T:
        """The part, made if it is not kept."""
        part = self._part
        if part is None:
            part = self._part = make()
            made = self._made[self._kind]
            made.append((ref(self), self._size(part)))
            while len(made) > 1 and (len(made) > self._kept or self._taken(made) > self._most):
                if (oldest := made.popleft()[0]()) is not None:
                    oldest._part = None
        return part

    @staticmethod
    def _taken(made: deque[tuple[ref[Recent[Any]], int]]) -> int:
        """Bytes of those that are still there."""
        return sum(size for part, size in made if part() is not None)
