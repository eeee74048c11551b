"""A recording that was not ended, saved into a new file up to its last whole chunk."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

from flexviz.errors import InputError
from flexviz.recording.checking import Checked, check_recording
from flexviz.recording.files import beside, hidden, write_sidecar
from flexviz.recording.web import rerun_program

NOTHING = "holds nothing that could be saved: the program was killed before anything was written"


def repair_recording(path: str | Path) -> Checked:
    """Write what is readable of a truncated recording beside it, as `<name>.repaired.rrd`, with a footer.

    The file itself is left as it is.

    Raises
    ------
    InputError: there is nothing to be saved, or the file is damaged in its middle.
    """
    file = Path(path)
    target = beside(file, "repaired")
    part = hidden(target)
    try:
        # Rerun's own tool: it reads every whole message and writes them anew with a footer
        run = subprocess.run(
            [str(rerun_program()), "rrd", "optimize", str(file), "-o", str(part)],
            capture_output=True,
            text=True,
        )
        if run.returncode != 0 or not part.is_file():
            empty = file.stat().st_size < 1000
            raise InputError(NOTHING if empty else "is damaged, and cannot be repaired", file=file)
        try:
            checked = check_recording(part)
        except InputError:
            raise InputError(NOTHING, file=file) from None
        os.replace(part, target)
    except OSError as error:
        raise InputError(f"cannot be repaired ({error.strerror or error})", file=file) from None
    finally:
        part.unlink(missing_ok=True)
    write_sidecar(target, checked.sha256)
    return check_recording(target)
