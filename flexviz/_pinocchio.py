"""Pinocchio as an untyped module: its names come from a compiled extension that type checkers cannot see."""

from typing import Any

import pinocchio

pin: Any = pinocchio
