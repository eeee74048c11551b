"""The results document: one model of a result, written and read.

`flexviz identify --json`, `flexviz diagnose --json`, `flexviz export --to json|yaml`, a report's JSON and a
recording hold this document or parts of it. Files are checked strictly, further keys are ignored. The schema
is docs/results-schema.json.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from flexviz.base.errors import InputError
from flexviz.base.facts import Fact
from flexviz.base.pages import Shown
from flexviz.base.schemas import input_error
from flexviz.content.records import NOTE_KINDS, Note, ParameterEstimate, curve_tables
from flexviz.content.rendering import html_fragment, text
from flexviz.content.results.fields import EveryResult, ResultFields
from flexviz.content.results.frame import DataFrame, parameter_frame
from flexviz.content.results.lookup import find_parameter

LARGEST_BYTES = 50_000_000
SUFFIXES = (".json", ".yaml", ".yml")


class ResultDocument(ResultFields, Shown, frozen=True):
    """A result: of an identification, a diagnosis or an export.

    A diagnosis has `verdict`, `candidates`, `where`, `steps` and `model`; an identification has `parameters`
    and what belongs to one fit. What a result does not have is left out.
    """

    def __getitem__(self, key: str | tuple[str, str | None]) -> ParameterEstimate:
        """A parameter by name and place: `document["stiffness", "joint1"]`."""
        return find_parameter(self.all_parameters, key)

    def summary(self, width: int = 140) -> str:
        """The result as text: tables and sentences, `width` columns wide."""
        return text(self.blocks(), width)

    def _repr_html_(self) -> str:
        return html_fragment(self.blocks())

    def to_frame(self) -> DataFrame:
        """The parameters as a table of pandas; MissingPackage if that is not installed."""
        return parameter_frame(self.all_parameters)

    def to_dict(self) -> dict[str, Any]:
        """The document as JSON holds it."""
        return self.model_dump(mode="json", exclude_unset=True)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ResultDocument) and self.to_dict() == other.to_dict()

    @staticmethod
    def from_dict(data: Mapping[str, Any]) -> ResultDocument:
        """The document of what `to_dict` gave; pydantic's ValidationError for anything else."""
        text = json.dumps(data, default=str)
        return ResultDocument.model_validate_json(text, strict=True)


def shared_fields(result: EveryResult, kind: type[EveryResult]) -> dict[str, Any]:
    """What a document has of a result under the same name: the fields of `kind`."""
    return {field.name: getattr(result, field.name) for field in fields(kind)}


def note_entries(facts: Iterable[Fact]) -> dict[str, Any]:
    """Both forms of a document's notes, in words; kinds that documents do not know are "other"."""
    notes = [Note(NOTE_KINDS.get(fact.kind, "other"), fact.text) for fact in facts]
    return {"notes": [note.text for note in notes], "typed_notes": notes}


def curve_entries(parameters: Iterable[ParameterEstimate]) -> dict[str, Any]:
    """A document's tables of the free curves in a model, if it has any."""
    tables = curve_tables(parameters)
    return {"curves": tables} if tables else {}


def json_schema() -> str:
    """The text of docs/results-schema.json."""
    schema = ResultDocument.model_json_schema(mode="serialization")
    schema = json.loads(json.dumps(schema), parse_constant=lambda _: None)  # a default of NaN is null
    return json.dumps({"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}, indent=1) + "\n"


def read_result(file: str | Path) -> ResultDocument:
    """A result file, as `identify --json`, `diagnose --json` or `export` wrote it.

    Raises:
        InputError: naming file and place, if it is not a valid result file.
    """
    file = Path(file)
    suffix = file.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"not a result file, expected {' or '.join(SUFFIXES[:2])}", file=file)
    try:
        if file.stat().st_size > LARGEST_BYTES:
            raise InputError(f"larger than {LARGEST_BYTES:,} bytes, expected a result", file=file)
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read ({getattr(error, 'strerror', None) or error})", file=file) from None
    try:
        data = json.loads(text) if suffix == ".json" else _yaml(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"not valid {suffix[1:].upper()} ({error})", file=file) from None
    return checked_document(data, file)


def checked_document(data: Any, file: Path) -> ResultDocument:
    """The validated document of `data` from `file`."""
    if not isinstance(data, dict) or not {"parameters", "model"} & data.keys():
        raise InputError(
            'holds no "parameters"; expected what "flexviz identify --json", "flexviz diagnose --json" or '
            '"flexviz export" write',
            file=file,
        )
    try:
        return ResultDocument.from_dict(data)
    except ValidationError as error:
        raise input_error(error, data, file) from None


def _yaml(text: str) -> Any:
    from ruamel.yaml import YAML, YAMLError

    try:
        return YAML(typ="safe", pure=True).load(text)
    except YAMLError as error:
        raise ValueError(str(error)) from None
