"""A session as a folder: the measurement set with session.json and session.npz beside it.

So a saved session is a measurement set too, can be moved, and holds everything it needs. Undo and redo come
back with it.
"""

from __future__ import annotations

import io
import json
import os
import shutil
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from flexviz.errors import InputError
from flexviz.measurements import MeasurementSet
from flexviz.session.state import HISTORY, Analysis, Session, Step

SESSION_FILE = "session.json"
ARRAYS_FILE = "session.npz"
FORMAT = 1
LARGEST_JSON = 200_000_000  # bytes
LEFT_OUT = shutil.ignore_patterns(".*", "*.rrd", "*.rrd.sha256", SESSION_FILE, ARRAYS_FILE, "__pycache__")


def save_session(session: Session, measurements: MeasurementSet, folder: Path) -> Path:
    """Keep a session in `folder` (new, or a session's own, which is then renewed); returns the folder."""
    own = folder.resolve() == measurements.path.resolve()
    if folder.exists() and not own and any(folder.iterdir()):
        raise InputError(f"{folder} exists and is not empty")
    try:
        if own:
            _write(session, measurements.path, folder)
            return folder
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=f".{folder.name}.", dir=folder.parent) as temporary:
            copy = Path(temporary) / "copy"
            shutil.copytree(measurements.path, copy, ignore=LEFT_OUT)
            _write(session, measurements.path, copy)
            if folder.exists():
                folder.rmdir()
            os.replace(copy, folder)
    except OSError as error:
        raise InputError(f"cannot be saved ({error.strerror or error})", file=folder) from None
    return folder


def _write(session: Session, path: Path, folder: Path) -> None:
    from flexviz.session.packing import Packer  # heavy: it knows every kind of result

    packer = Packer(path)
    steps = {name: [packer.pack(step) for step in getattr(session, name)] for name in ("past", "future")} | {
        "present": packer.pack(session.present)
    }
    document = {"format": FORMAT, **steps, "shared": packer.shared}
    arrays = io.BytesIO()
    np.savez_compressed(arrays, **{f"a{i}": a for i, a in enumerate(packer.arrays)})  # type: ignore[arg-type]
    for name, content in ((ARRAYS_FILE, arrays.getvalue()), (SESSION_FILE, json.dumps(document).encode())):
        part = folder / f".{name}.part"
        part.write_bytes(content)
        os.replace(part, folder / name)


def load_session(measurements: MeasurementSet) -> Session | None:
    """The session kept beside a measurement set, or None where there is none."""
    file = measurements.path / SESSION_FILE
    if not file.is_file():
        return None
    from flexviz.session.packing import Unpacker

    try:
        if file.stat().st_size > LARGEST_JSON:
            raise InputError("larger than any session")
        document = json.loads(file.read_text(encoding="utf-8"))
        if not isinstance(document, dict) or document.get("format") != FORMAT:
            raise InputError(f"format {FORMAT} is needed")
        with np.load(measurements.path / ARRAYS_FILE, allow_pickle=False) as npz:
            arrays = [npz[f"a{i}"] for i in range(len(npz.files))]
        unpacker = Unpacker(measurements.path, arrays, document.get("shared", []))
        past = [_step(unpacker.unpack(step), measurements) for step in document.get("past", [])]
        future = [_step(unpacker.unpack(step), measurements) for step in document.get("future", [])]
        present = _step(unpacker.unpack(document["present"]), measurements)
    except InputError as error:
        raise InputError(f"not a usable session: {error}", file=file) from None
    except (OSError, ValueError, TypeError, KeyError, AttributeError, zipfile.BadZipFile) as error:
        raise InputError(f"not a usable session ({type(error).__name__}: {error})", file=file) from None
    return Session(present, tuple(past[-HISTORY:]), tuple(future[:HISTORY]))


def _step(step: Any, measurements: MeasurementSet) -> Step:
    """A step whose settings fit the set."""
    from flexviz.effects import choose_effects
    from flexviz.observers import make_observer

    if (
        not isinstance(step, Step)
        or not isinstance(step.analysis, Analysis)
        or not isinstance(step.label, str)
    ):
        raise InputError("a step of the history is something else")
    analysis = step.analysis
    if analysis.path != measurements.path:
        raise InputError("it belongs to another measurement set")
    names = [group.name for group in measurements.groups]
    if [name for name, _ in analysis.roles] != names:
        raise InputError(f"its groups are not the set's ({', '.join(names)})")
    for name, role in analysis.roles:
        analysis.with_role(name, role)
    payloads = tuple(name for name, bodies in measurements.payloads.items() if bodies)
    choose_effects(analysis.effects, measurements.joints, payloads, names)
    make_observer(analysis.observer, analysis.bandwidth)
    if not isinstance(analysis.refine, bool):
        raise InputError("refine is neither true nor false")
    return step


def zipped(folder: Path) -> bytes:
    """A session's (or a measurement set's) folder as a zip file."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for file in sorted(folder.rglob("*")):
            inside = file.relative_to(folder)
            if file.is_file() and not any(part.startswith(".") for part in inside.parts):
                archive.write(file, f"{folder.name}/{inside.as_posix()}")
    return buffer.getvalue()
