"""Tasks of a batch and their kept results.

A task is named by the SHA-256 of everything that determines its result: kind, content of the data, options,
flexviz's own files. Its result is one file of that name, written completely or not at all, so that a run can
end at any time, go on later, and count nothing twice.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from flexviz.base.errors import InputError, one_line
from flexviz.base.files import as_json, named_errors, remove_leftovers, sha256_of, write_whole
from flexviz.base.limits import read_json

Json = dict[str, Any]
FORMAT = 1
KEPT = "done"  # folder of the results
LARGEST_RESULT = 50_000_000  # [bytes] of one of them


@cache
def code_sha256() -> str:
    """SHA-256 of flexviz's own files: after a change of the program no earlier result counts."""
    found, package = hashlib.sha256(), Path(__file__).parents[2]
    for file in sorted(package.rglob("*.py")):
        found.update(f"{file.relative_to(package).as_posix()} {sha256_of(file)};".encode())
    return found.hexdigest()


@dataclass(frozen=True)
class BatchTask:
    """One piece of work in plain data.

    Attributes:
        kind: names the function that does it, in `working.KINDS`.
        title: for progress.
        what: all that determines the result.
        where: where its data are found, which does not change the result.
    """

    kind: str
    title: str
    what: Json
    where: Json

    @property
    def key(self) -> str:
        """Its name: hexadecimal SHA-256."""
        named = {"kind": self.kind, "what": self.what, "code": code_sha256()}
        return hashlib.sha256(json.dumps(named, sort_keys=True).encode()).hexdigest()

    def text(self) -> str:
        """What a worker is told."""
        told = {"kind": self.kind, "key": self.key, "what": self.what, "where": self.where}
        return json.dumps({**told, "code": code_sha256()})


class TaskResult(BaseModel):
    """What became of a task.

    Attributes:
        result: what the kind of task returns; None after an error.
        error: why there is none, in one line.
        lasting: whether the same task would give the same again; otherwise the next run tries it once more.
        seconds: duration [s].
    """

    model_config = ConfigDict(extra="ignore", frozen=True, strict=True)

    format: int = FORMAT
    key: str
    result: Json | None = None
    error: str = ""
    lasting: bool = True
    seconds: float = 0.0


class ResultStore:
    """The kept results in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def file(self, key: str) -> Path:
        """The file of a task's result."""
        return self.folder / KEPT / key[:2] / f"{key}.json"

    def get(self, key: str) -> TaskResult | None:
        """The result of a task, or None; a file that cannot be read counts as missing."""
        file = self.file(key)
        try:
            found = TaskResult.model_validate(read_json(file, LARGEST_RESULT))
        except (OSError, InputError, ValidationError):
            return None
        return found if found.key == key and found.format == FORMAT else None

    def put(self, result: TaskResult) -> None:
        """Keep a result."""
        file = self.file(result.key)
        with named_errors(file):
            file.parent.mkdir(parents=True, exist_ok=True)
            write_whole(file, as_json(result.model_dump()).encode())

    def clean(self) -> None:
        """Remove what a killed run has left half written."""
        for folder in (self.folder, *self.folder.glob(f"{KEPT}/*/")):
            remove_leftovers(folder, age=0.0)


def failed(key: str, reason: str, lasting: bool = False) -> TaskResult:
    """The result of a task that has none."""
    return TaskResult(key=key, error=one_line(reason), lasting=lasting)
