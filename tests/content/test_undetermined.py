"""What the data do not determine: no outlet prints a value or an interval of it."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace

import pytest

from flexviz.analysis.identification import Identification, identify
from flexviz.content.records import Combination, EffectParameter, ParameterEstimate
from flexviz.content.rendering import panel
from flexviz.content.results import ResultDocument
from flexviz.content.topics import parameter_panel
from flexviz.content.wording import (
    determined,
    estimate_cells,
    estimate_mark,
    estimate_words,
    interval_words,
    value_text,
)
from flexviz.data.measurements import MeasurementSet


def stiffness(value: float, std: float, grade: str, above: float | None = None) -> ParameterEstimate:
    return ParameterEstimate("stiffness", "joint1", value, std, "Nm/rad", grade, rigid_above=above)  # type: ignore[arg-type]


def test_no_interval_of_what_is_not_determined() -> None:
    no = stiffness(25e3, 5e5, "no", 952.0)
    assert math.isnan(no.std) and "500000" not in repr(no)
    assert math.isnan(Combination("izz", 1.0, 2.0, "kg m²", "no").std)
    assert estimate_words(no) == "not determined (above 952 Nm/rad)"
    assert interval_words(no) == "not determined (above 952)"
    assert estimate_cells(no, 1e-3) == ("not determined", "(above 0.952)")
    assert estimate_words(stiffness(25e3, 5e5, "no")) == "not determined"


def test_a_value_less_than_its_interval_is_not_determined() -> None:
    assert estimate_words(stiffness(1000.0, 600.0, "weak")) == "not determined"
    assert "±" in estimate_words(stiffness(1000.0, 500.0, "weak"))
    assert determined(stiffness(0.0, 1e-4, "yes"))  # known to be none
    wide = EffectParameter(0.31, 0.46, "Nm")
    assert value_text("coulomb_friction", "coulomb", wide) == "not determined"
    assert value_text("coulomb_friction", "coulomb", EffectParameter(3.0, 0.01, "Nm")) == "3.000 ± 0.020 Nm"
    assert value_text("coulomb_friction", "coulomb", EffectParameter(3.0, math.nan, "Nm")) == "3.00 Nm"


@pytest.fixture(scope="module")
def lacking(demo: MeasurementSet) -> Identification:
    """Without the friction that the arm has; besides, the stiffness of joint2 is above something."""
    found = identify(demo)
    soft = found["stiffness", "joint2"]
    estimates = (replace(p, rigid_above=653.0) if p == soft else p for p in found.parameters)
    return replace(found, parameters=tuple(estimates))


def test_every_outlet(lacking: Identification) -> None:
    found = lacking["stiffness", "joint2"]
    assert found.identifiable == "no" and found.rigid_above is not None
    (line,) = (row for row in lacking.summary(160).splitlines() if re.match(r" ?stiffness +joint2 ", row))
    assert re.search(r"not determined +\(above \d+", line), line
    for row in lacking.summary(160).splitlines():
        assert not re.search(r"  no\b", row) or "not determined" in row or "at bound" in row, row
    for row in lacking.summary(80).partition("link encoders")[0].splitlines():
        assert not re.match(r" ?\w+ .*  no\b", row) or re.search(r"  –  +–  ", row) or "at bound" in row, row
    assert "– is not determined by these data" in lacking.summary(80)

    written = json.loads(json.dumps(lacking.to_dict()))
    entries = [*written["parameters"], *written.get("base_parameters", ())]
    assert any(p["identifiable"] == "no" for p in entries)
    assert all(p["std"] is None for p in entries if p["identifiable"] == "no")
    read = ResultDocument.model_validate_json(json.dumps(written))
    assert read["stiffness", "joint2"].identifiable == "no"

    app = panel(parameter_panel(lacking))
    for row in re.findall(r"<tr title.*?</tr>", app):
        assert "○" not in row or "not determined" in row or "⚑" in row, row
    assert estimate_mark(found) == "○"  # in the report, whose legend says what it means
