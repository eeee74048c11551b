"""The results document: one model of a result, written and read.

`flexviz identify --json`, `flexviz diagnose --json`, `flexviz export --to json|yaml`, a report's JSON and a
recording hold this document or parts of it. Files are checked strictly, further keys are ignored. The schema
is docs/results-schema.json.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

from flexviz.results.entries import ParameterEntry, ResultFields
from flexviz.results.grades import Note
from flexviz.results.lookup import find_parameter
from flexviz.results.summary import html, text


class ResultDocument(ResultFields):
    """A result: of an identification, a diagnosis or an export.

    A diagnosis has `verdict`, `candidates`, `where`, `steps` and `model`; an identification has `parameters`
    and what belongs to one fit. What a result does not have is left out.
    """

    def __getitem__(self, key: str | tuple[str, str | None]) -> ParameterEntry:
        """A parameter by name and place: `document["stiffness", "joint1"]`."""
        return find_parameter(self.all_parameters, key)

    def summary(self, width: int = 140) -> str:
        """The result as text: tables and sentences, `width` columns wide."""
        return text(self, width)

    def _repr_html_(self) -> str:
        return html(self)

    def to_dict(self) -> dict[str, Any]:
        """The document as JSON holds it."""
        return self.model_dump(mode="json", exclude_unset=True)

    @staticmethod
    def from_dict(data: Mapping[str, Any]) -> ResultDocument:
        """The document of what `to_dict` gave; pydantic's ValidationError for anything else."""
        text = json.dumps(data, default=str)
        return ResultDocument.model_validate_json(text, strict=True)


def note_entries(notes: Iterable[Note]) -> dict[str, Any]:
    """Both forms of a document's notes."""
    notes = list(notes)
    return {"notes": [note.text for note in notes], "typed_notes": notes}


def json_schema() -> str:
    """The text of docs/results-schema.json."""
    schema = ResultDocument.model_json_schema(mode="serialization")
    return json.dumps({"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}, indent=1) + "\n"
