"""NumPy .npz archives of named arrays."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from flexviz.base.limits import check_npz
from flexviz.data.logs.formats.arrays import IN_PYTHON, Flattening
from flexviz.data.logs.formats.base import Log, LogFormat, ReadOptions
from flexviz.data.measurements import readable


def read_npz(path: Path, options: ReadOptions) -> Log:
    """All columns of numbers; arrays of Python objects are not unpickled."""
    flattening, arrays = Flattening(*IN_PYTHON), {}
    with readable(path, ".npz archive"):
        check_npz(path)
        with np.load(path, allow_pickle=False) as content:
            for name in content.files:
                try:
                    arrays[name] = content[name]
                except ValueError:
                    flattening.unusable[name] = "it holds Python objects"
    return flattening.log(path, "NumPy", arrays)


NUMPY = LogFormat(".npz", read_npz, suffixes=(".npz",))
