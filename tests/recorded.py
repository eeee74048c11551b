"""A recording read back, for the tests: with Rerun's own reader, none of flexviz's code."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from PIL import Image
from rerun.chunk import RrdReader


class Read:
    """A recording's content by entity, in the order in which it was logged."""

    def __init__(self, file: Path) -> None:
        self.reader = RrdReader(str(file))
        self.batches: dict[str, list[pa.RecordBatch]] = {}
        for chunk in self.reader.stream():
            self.batches.setdefault(chunk.entity_path, []).append(chunk.to_record_batch())
        for batches in self.batches.values():
            batches.sort(key=lambda batch: batch.column("rerun.controls.RowId")[0].as_py())

    def component(self, entity: str, name: str) -> Any:
        """All rows of a component, the lists of one row flattened."""
        found = [batch for batch in self.batches[entity] if name in batch.schema.names]
        if not found:
            raise KeyError((entity, name))
        return np.array([value for batch in found for value in batch.column(name).flatten().to_pylist()])

    def line(self, entity: str, timeline: str = "time") -> tuple[np.ndarray, np.ndarray]:
        """Instants ([s], or a sequence) and values of a scalar entity."""
        instants, values = [], []
        for batch in self.batches[entity]:
            if "Scalars:scalars" in batch.schema.names:
                index = batch.column(timeline)
                ticks = np.asarray(index.cast(pa.int64()))
                instants.append(ticks * 1e-9 if pa.types.is_duration(index.type) else ticks)
                values.append(np.array(batch.column("Scalars:scalars").flatten()))
        return np.concatenate(instants), np.concatenate(values)

    def picture(self, entity: str) -> Image.Image:
        """A drawn chart as it stands in the end."""
        blob = self.component(entity, "EncodedImage:blob")
        return Image.open(io.BytesIO(bytes(np.asarray(blob, dtype=np.uint8).ravel())))

    def colours(self, entity: str) -> tuple[np.ndarray, np.ndarray]:
        """The colours of a drawn chart (C, 3) and how many pixels have each (C,)."""
        pixels = np.asarray(self.picture(entity).convert("RGB")).reshape(-1, 3)
        return np.unique(pixels, axis=0, return_counts=True)

    def text(self, entity: str) -> str:
        """A text as it stands in the end."""
        return str(self.component(entity, "TextDocument:text")[-1])


def blueprint_of(file: Path) -> dict[str, list[Any]]:
    """Component -> all its values in the only blueprint."""
    reader = RrdReader(str(file))
    (store,) = reader.blueprints()
    values: dict[str, list[Any]] = {}
    for chunk in reader.stream(store=store):
        batch = chunk.to_record_batch()
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            if not pa.types.is_timestamp(column.type):
                values.setdefault(name, []).extend(column.to_pylist())
    return values
