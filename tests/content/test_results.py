"""The results document: written, read, looked into; the results as a user meets them in Python."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flexviz
from flexviz.analysis.identification import Identification, identify
from flexviz.base.errors import FlexvizError, InputError
from flexviz.base.files import as_json
from flexviz.base.resources import sessions_dir
from flexviz.content.results import ParameterNotFound, ResultDocument, json_schema, read_result
from flexviz.data.measurements import read_set
from tests.found import DIAGNOSIS, GUARD, MAPS, TIED_DIAGNOSIS

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def result() -> Identification:
    return identify(read_set(sessions_dir() / "planar-2r-demo"))


def test_the_schema_in_the_docs_is_current() -> None:
    assert (ROOT / "docs" / "results-schema.json").read_text(encoding="utf-8") == json_schema()


def test_what_is_written_is_read_back(result: Identification, tmp_path: Path) -> None:
    for found in (
        result,
        DIAGNOSIS,
        TIED_DIAGNOSIS,
        replace(DIAGNOSIS, guard=None, free_curve=None, maps=()),
    ):
        file = tmp_path / "result.json"
        file.write_text(as_json(found.to_dict()), encoding="utf-8")
        again = read_result(file)
        assert again == found.document() and again.to_dict() == found.to_dict()
        assert again.summary() == found.summary()


def test_a_diagnosis_holds_everything_that_was_found() -> None:
    document = json.loads(as_json(DIAGNOSIS.to_dict()))
    (tie,) = document["candidates"][0]["inseparable_from"]
    assert tie["would_separate"].startswith("A payload twice as heavy")
    assert (
        document["guard"]["texts"] == [fact.text for fact in GUARD.facts()]
        and not document["guard"]["parameters"][1]["trusted"]
    )
    assert document["free_curve"]["variable"] == "velocity" and len(document["maps"]) == len(MAPS)
    assert document["maps"][0]["mean"][0][3] is None  # an empty bin
    assert document["notes"] == [note["text"] for note in document["typed_notes"]]
    assert document["typed_notes"][0]["kind"] == "unexplained"
    assert document["model"]["parameters"][4]["std"] is None  # infinite
    assert "steps" not in DIAGNOSIS.to_dict(steps=False)


def test_a_family_stands_with_its_finding_and_with_the_step_that_adds_it() -> None:
    document = json.loads(as_json(TIED_DIAGNOSIS.to_dict()))
    tied, offset = document["candidates"]
    expected = {
        "name": "dry_friction",
        "tied": True,
        "members": ["coulomb_friction", "link_coulomb_friction"],
        "confidence": 0.97,
    }
    assert tied["family"] == expected == document["steps"][1]["added"]["family"]
    assert tied["effect"] == "coulomb_friction" and tied["confidence"] == 0.4
    assert "family" not in offset and "family" not in DIAGNOSIS.to_dict()["steps"][1]["added"]
    assert TIED_DIAGNOSIS.findings[0].to_dict()["family"] == expected


def test_the_trace_of_the_search_and_its_decoys() -> None:
    document = TIED_DIAGNOSIS.to_dict()
    assert [(move["kind"], move["accepted"]) for move in document["trace"]] == [
        ("add", True), ("add", False), ("swap", False),
    ]  # fmt: skip
    assert document["trace"][1]["why"] == "within its error" and document["trace"][2]["removed"]
    assert document["decoys"] == {"accepted": 0, "tried": 40}
    without = replace(
        TIED_DIAGNOSIS, trace=(replace(TIED_DIAGNOSIS.trace[0], error=float("inf")),), decoys=None
    )
    assert without.to_dict()["trace"][0]["error"] is None and "decoys" not in without.to_dict()
    old = {key: value for key, value in TIED_DIAGNOSIS.to_dict().items() if key not in ("trace", "decoys")}
    assert ResultDocument.from_dict(old).trace == ()


def test_results_are_compared_by_identity_and_can_be_hashed(result: Identification) -> None:
    for one in (result, DIAGNOSIS, DIAGNOSIS.steps[0], DIAGNOSIS.findings[0], GUARD, MAPS[0]):
        assert one == one and one != replace(one) and len({one, one}) == 1


def test_repr_is_one_line(result: Identification) -> None:
    assert repr(result).startswith("<Identification of planar-2r-demo: converged, ")
    assert repr(DIAGNOSIS) == "<Diagnosis of small: missing, coulomb_friction:joint2>"
    assert len(repr(result)) < 120


def test_parameters_by_name(result: Identification) -> None:
    found = result["stiffness", "joint1"]
    assert found.value == result.model.stiffness[0] and result["stiffness:joint1"] is found
    assert result.document()["stiffness", "joint1"].value == found.value
    assert DIAGNOSIS["coulomb_friction.coulomb"].joint == "joint2"  # one place only


@pytest.mark.parametrize(
    "key, says",
    [
        (("stifness", "joint1"), 'no parameter "stifness"; did you mean "stiffness"'),
        (("stiffness", "joint9"), 'parameter "stiffness" "joint9": did you mean "joint'),
        ("stiffness", 'parameter "stiffness" without a place: valid: joint1, joint2'),
    ],
)
def test_a_wrong_name_is_answered_with_a_suggestion(
    result: Identification, key: str | tuple[str, str], says: str
) -> None:
    with pytest.raises(ParameterNotFound) as caught:
        result[key]
    assert says in str(caught.value)
    assert isinstance(caught.value, KeyError) and isinstance(caught.value, FlexvizError)


def test_the_summary_is_a_table(result: Identification) -> None:
    text = result.summary()
    row = next(
        line for line in text.splitlines() if line.strip().startswith("motor_inertia") and "joint1" in line
    )
    assert "kg m²" in row and " weak " in row  # the set's model lacks friction
    assert (
        re.search("joint +fit +held out +torque explained +noise", text)
        and "observer butterworth-zero-phase" in text
    )
    html = result._repr_html_()
    assert html.count("<table") == 4 and "<td>stiffness</td>" in html
    assert "Missing:</b> Coulomb friction on joint2:" in DIAGNOSIS._repr_html_()


def test_files_are_checked_strictly(tmp_path: Path) -> None:
    document = DIAGNOSIS.to_dict()
    document["verdict"] = "maybe"
    file = tmp_path / "result.json"
    file.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(InputError, match="verdict"):
        read_result(file)
    file.write_text(json.dumps(DIAGNOSIS.to_dict() | {"guard": "x"}), encoding="utf-8")
    with pytest.raises(InputError, match="guard"):
        read_result(file)
    document = DIAGNOSIS.to_dict() | {"torque": {"joints": ["joint1"], "spread": [1.0, 2.0]}}
    file.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(InputError, match=r"torque: .*spread has 2 values, expected 1, one per joint"):
        read_result(file)
    assert ResultDocument.from_dict(DIAGNOSIS.to_dict() | {"added_later": 1}) == DIAGNOSIS.document()
    assert np.isfinite(DIAGNOSIS.document().all_parameters[0].value)


def test_records_are_read_back_from_a_file() -> None:
    document = TIED_DIAGNOSIS.to_dict()
    again = ResultDocument.from_dict(document)
    assert again.trace == TIED_DIAGNOSIS.trace and again.where == TIED_DIAGNOSIS.where
    first, (tie,) = again.candidates[0], TIED_DIAGNOSIS.findings[0].inseparable_from
    assert first.inseparable_from == (tie,) and first.family == TIED_DIAGNOSIS.findings[0].family
    for mine, other in zip(again.maps, MAPS, strict=True):
        for name in ("centres", "mean", "std", "count"):
            read, made = getattr(mine, name), getattr(other, name)
            assert read.dtype == made.dtype
            np.testing.assert_array_equal(read, made)  # NaN in an empty bin
    assert again.free_curve is not None and again.free_curve.certain
    document["trace"][0] |= {"error": None, "added_later": 1}
    assert np.isnan(ResultDocument.from_dict(document).trace[0].error)


@pytest.mark.parametrize(
    "value, says",
    [
        ([[1.0], [1.0, 2.0]], r"maps, entry 1, mean: .*expected numbers in rows of equal length"),
        ([[1.0, "a"]], 'maps, entry 1, mean, entry 1, entry 2: found "a", expected a number'),
        ([[1.0, float("inf")]], "entry 2: found inf, expected a finite number"),
        (3.0, "maps, entry 1, mean: found 3.0, expected a list"),
    ],
)
def test_what_is_wrong_with_an_array_in_a_file(value: object, says: str, tmp_path: Path) -> None:
    document, file = DIAGNOSIS.to_dict(), tmp_path / "result.json"
    document["maps"][0]["mean"] = value
    file.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(InputError, match=says):
        read_result(file)
    document["maps"][0] = 1
    file.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(InputError, match="maps, entry 1: found 1, expected a table"):
        read_result(file)
    document["maps"] = [DIAGNOSIS.to_dict()["maps"][0] | {"count": [[10**30]], "curves": 1}]
    file.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(InputError, match=r"curves: found 1, expected a list \(and 1 more to correct\)"):
        read_result(file)


def test_the_public_names_exist_and_open_a_session(tmp_path: Path) -> None:
    for name in flexviz.__all__:
        assert getattr(flexviz, name) is not None, name
    session = flexviz.Session.open(sessions_dir() / "planar-2r-demo")
    folder = session.save(tmp_path / "kept")
    assert flexviz.Session.open(folder).session.analysis.roles == session.session.analysis.roles


def test_the_values_of_what_was_added_after_the_first_effect_are_told() -> None:
    """They are not among the candidates, which stand beside the set's own model."""

    def value(number: float, unit: str) -> dict[str, object]:
        return {"value": number, "std": 0.001, "unit": unit}

    friction = {"effect": "coulomb_friction", "joint": "joint1", "confidence": 0.99}
    backlash = {"effect": "backlash", "joint": "joint2", "confidence": 0.95}
    values = {"coulomb": value(3.0, "Nm")}, {"half_width": value(0.25, "rad")}
    rival = backlash | {"confidence": 0.0, "score": 0.1, "parameters": {"half_width": value(0.5, "rad")}}
    errors = {"rms": [1.0, 1.0], "verdict": "missing"}
    document = ResultDocument.from_dict(
        {
            "format": 1,
            "set": "s",
            "verdict": "missing",
            "candidates": [friction | {"score": 0.9, "parameters": values[0]}, rival],
            "steps": [errors, errors | {"added": friction}, errors | {"added": backlash}],
            "model": {
                "effects": [
                    {"effect": one["effect"], "joint": one["joint"], "parameters": found}
                    for one, found in zip((friction, backlash), values, strict=True)
                ],
                "parameters": [],
            },
        }
    )
    text = document.summary()
    assert text.count("then added:") == 1
    assert "then added: Backlash on joint2 (backlash): half width 0.2500 ± 0.0020 rad; removes < 1 %" in text
    assert "2. Backlash on joint2 (backlash): half width 0.5000 ± 0.0020 rad" in text
