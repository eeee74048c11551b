"""Where recordings and small faulty inputs are that are not part of the project; tests skip without them."""

from __future__ import annotations

from pathlib import Path

_BESIDE = [parent / "shared" for parent in Path(__file__).resolve().parents]
SHARED = next((folder for folder in _BESIDE if folder.is_dir()), _BESIDE[2])
REAL, FAULTS = SHARED / "real", SHARED / "faults"
