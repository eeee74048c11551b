"""Large parts of which only those made last are kept."""

from __future__ import annotations

import math
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

    _made: ClassVar[dict[str, list[ref[Recent[Any]]]]] = {}  # by kind

    def __init__(
        self, kind: str, kept: int, size: Callable[[T], int] = lambda _: 0, most: float = math.inf
    ) -> None:
        self._kind, self._kept, self._size, self._most = kind, kept, size, most
        self._part: T | None = None
        self._bytes = 0

    def get(self, make: Callable[[], T]) -> T:
        """The part, made if it is not kept."""
        part = self._part
        if part is None:
            part = self._part = make()
            self._bytes = self._size(part)
            alive = (one() for one in self._made.get(self._kind, ()))
            kept = [*(one for one in alive if one is not None), self]
            while len(kept) > 1 and (len(kept) > self._kept or sum(one._bytes for one in kept) > self._most):
                kept.pop(0)._part = None
            self._made[self._kind] = list(map(ref, kept))
        return part
