"""Memory that this process has freed."""

from __future__ import annotations

import ctypes
import sys

_libc = ctypes.CDLL(None) if sys.platform == "linux" else None


def return_freed() -> None:
    """Return freed memory to the system, where the C library can.

    glibc keeps what lies below a block in use: 18 diagnoses of different two-joint sets in one process ended
    with 735 MB instead of 175 MB.
    """
    trim = getattr(_libc, "malloc_trim", None)
    if trim is not None:
        trim(0)
