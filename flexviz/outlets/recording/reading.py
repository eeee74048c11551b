"""Recordings read back: integrity, properties, results and diagnoses."""

from __future__ import annotations

import json
import subprocess
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pyarrow as pa
from rerun.chunk import RrdReader

from flexviz.base.errors import InputError
from flexviz.base.files import sha256_of
from flexviz.content.comparing import KnownResults, effects_of
from flexviz.content.results import checked_document

TRUNCATED = ("no footer", "exceeds file size")  # in the reader's message on a truncated file
CUT = (
    "is truncated: the program that wrote it was killed, or the file was cut; "
    "`python -m rerun rrd optimize {} -o {}` writes what can be read of it"
)
ROW = "rerun.controls.RowId"
TEXT = "TextDocument:text"
PROPERTIES = "/__properties/flexviz"
_DECODE = """import sys
from rerun.chunk import RrdReader
for chunk in RrdReader(sys.argv[1]).stream():
    chunk.to_record_batch()
RrdReader(sys.argv[1]).store().summary()"""


@dataclass(frozen=True)
class Recorded:
    """A recording that was read back.

    Attributes:
        bytes, chunks: their numbers.
        entities: entity paths.
        sha256: of the file.
        confirmed: whether it agrees with `<file>.sha256`.
        complete: False if writing was stopped early.
    """

    file: Path
    bytes: int
    chunks: int
    entities: tuple[str, ...]
    sha256: str
    confirmed: bool = False
    complete: bool = True


def sidecar(file: Path) -> Path:
    """The recording's SHA-256 file, in the format of `sha256sum --check`."""
    return file.with_name(file.name + ".sha256")


def check_recording(path: str | Path, *, own: bool = False) -> Recorded:
    """Read a recording back.

    The viewer's own check accepts empty files and garbage, so every chunk is decoded here and counted against
    the footer, and the SHA-256 is compared with the .sha256 file if it exists. A file that this does not
    confirm is decoded in a child process first, because a damaged one may end Rerun's reader; not so where
    this program has just written it (`own`).

    Raises:
        InputError: truncated, damaged, empty, or not a recording.
    """
    file = Path(path)
    try:
        found = sha256_of(file)
        beside = sidecar(file).is_file()
        expected = sidecar(file).read_text().split()[0] if beside else found
    except (OSError, IndexError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "its .sha256 file cannot be read"
        raise InputError(f"cannot be read ({reason})", file=file) from None
    if not own and not (beside and found == expected):
        run = subprocess.run([sys.executable, "-P", "-c", _DECODE, str(file)], capture_output=True)
        if run.returncode < 0:
            message = f"is damaged: Rerun's reader ended with signal {-run.returncode}"
            raise InputError(message, file=file)
    with _read_errors(file):
        chunks, entities = _content(file)
        promised = len(RrdReader(str(file)).store().summary().splitlines())  # in the footer
    if found != expected:
        raise InputError("is damaged: its SHA-256 differs from its .sha256 file", file=file)
    if chunks == 0:
        raise InputError("is empty, expected a Rerun recording with data", file=file)
    if chunks != promised:
        raise InputError(f"is damaged: its footer lists {promised} chunks, found {chunks}", file=file)
    return Recorded(file, file.stat().st_size, chunks, entities, found, beside)


@contextmanager
def _read_errors(file: Path) -> Iterator[None]:
    """Turn the reader's errors and warnings on a damaged file into one InputError."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # the reader only warns about a truncated file
            yield
    except BaseException as error:
        if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
            raise  # a panic of the reader's Rust code is no Exception
        text = " ".join(str(error).split())
        if any(words in text for words in TRUNCATED):
            raise InputError(CUT.format(file, file.with_suffix(".whole.rrd")), file=file) from None
        raise InputError(f"is not a readable Rerun recording ({text})", file=file) from None


def _content(file: Path) -> tuple[int, tuple[str, ...]]:
    """Number of chunks, each of which is decoded, and entity paths."""
    entities = []
    for chunk in RrdReader(str(file)).stream():
        chunk.to_record_batch()
        entities.append(chunk.entity_path)
    return len(entities), tuple(dict.fromkeys(entities))


@dataclass(frozen=True)
class Recording:
    """A recording's properties and results; signals and motion stay in the file.

    Attributes:
        simulated: whether the measurement set was simulated.
        results: in the format of `identify --json`, with "label" and "effects" of the model; oldest first.
        diagnoses: in the format of `diagnose --json`; oldest first.
    """

    file: Path
    set_name: str
    robot: str
    simulated: bool
    joints: tuple[str, ...]
    groups: tuple[str, ...]
    results: tuple[dict[str, Any], ...]
    diagnoses: tuple[dict[str, Any], ...]

    @property
    def result(self) -> dict[str, Any]:
        """The newest result; empty if there is none."""
        return self.results[-1] if self.results else {}

    @property
    def known(self) -> KnownResults:
        """The newest result, and the newest diagnosis if it is of the same model, for a comparison."""
        own = [{key: value for key, value in one.items() if key != "effects"} for one in self.results[-1:]]
        read = partial(checked_document, file=self.file)
        fit, diagnosis = (next(map(read, found), None) for found in (own, self.diagnoses[-1:]))
        effects = tuple(self.result["effects"]) if own else None
        if effects is not None and diagnosis is not None and {*effects_of(diagnosis)} != {*effects}:
            diagnosis = None
        return KnownResults(self.file.stem, self.set_name, fit, diagnosis, effects=effects)


def read_recording(path: str | Path) -> Recording:
    """Read properties and results of an intact recording (see `check_recording`).

    Raises:
        InputError: not written by flexviz.
    """
    file = Path(path)
    properties: dict[str, Any] = {}
    texts: dict[str, tuple[bytes, str]] = {}
    for chunk in RrdReader(str(file)).stream():
        entity = chunk.entity_path
        if entity == PROPERTIES:
            properties |= _values(chunk.to_record_batch())
        elif entity.endswith("/json"):
            batch = chunk.to_record_batch()
            row, text = batch.column(ROW).to_pylist()[-1], batch.column(TEXT).to_pylist()[-1][0]
            texts[entity] = max(texts.get(entity, (b"", "")), (row, text))
    missing = [name for name in ("set", "robot", "simulated", "joints", "groups") if name not in properties]
    if missing:
        raise InputError(
            f"is not a flexviz recording (property {missing[0]} is missing), expected one written by "
            "`flexviz record` or the app",
            file=file,
        )
    return Recording(
        file=file,
        set_name=str(properties["set"][0]),
        robot=str(properties["robot"][0]),
        simulated=bool(properties["simulated"][0]),
        joints=tuple(properties["joints"]),
        groups=tuple(properties["groups"]),
        results=_documents(texts, "results", file),
        diagnoses=_documents(texts, "diagnoses", file),
    )


def _values(batch: pa.RecordBatch) -> dict[str, list[Any]]:
    return {
        name: column.to_pylist()[-1]
        for name, column in zip(batch.schema.names, batch.columns, strict=True)
        if name != ROW
    }


def _documents(texts: dict[str, tuple[bytes, str]], kind: str, file: Path) -> tuple[dict[str, Any], ...]:
    found: dict[int, dict[str, Any]] = {}
    for entity, (_, text) in texts.items():
        parts = entity.strip("/").split("/")
        if parts[0] != kind or not parts[1].isdigit():
            continue
        try:
            found[int(parts[1])] = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise InputError(f"{entity} cannot be read ({error})", file=file) from None
    return tuple(found[number] for number in sorted(found))
