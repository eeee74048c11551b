"""What may be wrong with samples: one kind a file, each of which registers itself."""

from __future__ import annotations

import pkgutil
from importlib import import_module

for found in pkgutil.iter_modules(__path__):
    import_module(f"{__name__}.{found.name}")
