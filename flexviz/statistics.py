"""Statistics that every room shares."""

from __future__ import annotations

NORMAL_95 = 1.96  # standard errors in half a 95 % interval of a normal distribution
