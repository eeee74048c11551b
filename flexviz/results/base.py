"""Common parts of the entries of a results document: base class and nullable numbers."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo


def nullable(value: Any, info: ValidationInfo) -> Any:
    """Numbers and arrays of a record with None for what is not finite; files are left to the strict check."""
    if info.mode == "json":
        return value
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [nullable(item, info) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def named(names: tuple[str, ...], data: Any) -> Any:
    """A tuple as a dictionary with these names; anything else unchanged."""
    return dict(zip(names, data, strict=True)) if isinstance(data, tuple) else data


Number = Annotated[float, Field(allow_inf_nan=False)]
Nullable = Annotated[Number | None, BeforeValidator(nullable)]
Column = Annotated[list[Number | None], BeforeValidator(nullable)]
Rows = Annotated[list[Column], BeforeValidator(nullable)]


class ResultEntry(BaseModel):
    """Part of a document."""

    model_config = ConfigDict(extra="ignore", frozen=True, from_attributes=True, populate_by_name=True)
