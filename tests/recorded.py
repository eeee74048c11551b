"""A recording read back, for the tests: with Rerun's own reader, none of flexviz's code."""

from __future__ import annotations

import io
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from PIL import Image
from rerun.chunk import RrdReader
from scipy.spatial.transform import Rotation

PLACE = "Transform3D"


@dataclass(frozen=True)
class Frame:
    """Places (M, 3) and turns (M, 4), x y z w, of a frame in its parent; None: that of the entity above."""

    parent: str | None
    places: np.ndarray
    turns: np.ndarray


def pose_of(frames: dict[str, Frame], name: str | None, row: int) -> np.ndarray:
    """(4, 4) of a frame at the row-th instant, in the outermost one."""
    pose = np.eye(4)
    while name in frames:
        frame, own = frames[name], np.eye(4)
        k = row if len(frame.places) > 1 else 0
        own[:3, :3] = Rotation.from_quat(frame.turns[k]).as_matrix()
        own[:3, 3] = frame.places[k]
        pose, name = own @ pose, frame.parent
    return pose


def readable_part(file: Path) -> Path:
    """The readable part of a truncated recording, written as the error of `check_recording` says."""
    whole = file.with_suffix(".whole.rrd")
    command = [sys.executable, "-m", "rerun", "rrd", "optimize", str(file), "-o", str(whole)]
    subprocess.run(command, check=True, capture_output=True)
    return whole


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

    def frames(self, below: str) -> dict[str, Frame]:
        """The named frames whose places were logged below an entity."""
        found: dict[str, Frame] = {}
        for entity, batches in self.batches.items():
            if entity.startswith(below) and any(f"{PLACE}:child_frame" in b.schema.names for b in batches):
                (name,) = set(self.component(entity, f"{PLACE}:child_frame"))
                assert name not in found, f"{name} is placed by two entities"
                parts = [b for b in batches if f"{PLACE}:parent_frame" in b.schema.names]
                parents = set(self.component(entity, f"{PLACE}:parent_frame")) if parts else {None}
                (parent,) = parents
                places = self.component(entity, f"{PLACE}:translation")
                turned = any(f"{PLACE}:quaternion" in b.schema.names for b in batches)
                turns = self.component(entity, f"{PLACE}:quaternion") if turned else [[0.0, 0.0, 0.0, 1.0]]
                found[name] = Frame(parent, np.asarray(places), np.asarray(turns))
        return found

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
