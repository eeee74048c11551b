"""A recording in Rerun's viewer inside a notebook."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import rerun as rr

from flexviz.base.errors import require_package


def notebook_viewer(file: Path, width: int | Literal["auto"] = "auto", height: int = 600) -> Any:
    """A `rerun.notebook.Viewer` with a recording, of this size [px]; it is displayed as the value of a cell.

    Raises:
        MissingPackage: rerun-notebook is not installed.
    """
    require_package("rerun_notebook", "Rerun's viewer in a notebook", f"rerun-notebook=={rr.__version__}")
    from rerun.notebook import Viewer

    stream = rr.RecordingStream("flexviz", make_default=False)
    viewer = Viewer(width=width, height=height, recording=stream)
    stream.log_file_from_path(file)
    stream.flush()
    return viewer
