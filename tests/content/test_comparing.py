"""Results side by side: of files, sessions and sets in any mixture."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from flexviz.content.blocks import TableBlock
from flexviz.content.comparing import KnownResults, compare, facts, numbers, remarks
from flexviz.content.session import save_session
from flexviz.outlets.terminal import main
from tests.found import DIAGNOSIS
from tests.small_session import small_session

FOUND = DIAGNOSIS.document()


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A set with its session, identified last, in folders "set" and "kept", and both results as files."""
    folder = tmp_path_factory.mktemp("compared")
    measurements, session = small_session(folder / "set")
    save_session(session, measurements, folder / "kept")
    fit = session.analysis.identification
    assert fit is not None
    for name, document in (("fit", fit.document()), ("found", FOUND)):
        (folder / f"{name}.json").write_text(json.dumps(document.to_dict()))
    return folder, fit


def texts(table: TableBlock) -> list[list[str]]:
    return [[cell.text for cell in row] for row in table.rows]


def test_a_difference_counts_in_standard_errors() -> None:
    first = next(p for p in FOUND.all_parameters if p.name == "stiffness" and 0 < p.std < p.value)
    for errors, differs in ((2.9, False), (3.1, True)):
        moved = replace(first, value=first.value + errors * 2**0.5 * first.std)
        parameters = tuple(moved if p is first else p for p in FOUND.all_parameters)
        other = replace(DIAGNOSIS, parameters=parameters).document()
        known = [KnownResults(name, "s", None, one) for name, one in (("a", FOUND), ("b", other))]
        found = compare(known)
        (row,) = (row for row in found.rows if (row.name, row.place) == ("stiffness", first.joint))
        assert row.deviations == pytest.approx(errors) and row.differs == differs
        (cells,) = (line for line in texts(numbers(found)) if line[:2] == ["stiffness", first.joint])
        assert (
            cells[-2] == f"{errors}{' !' if differs else ''}"
            and any("!" in one for one in remarks(found)) == differs
        )
    assert not any(row.differs for row in compare([known[0], known[0]]).rows)


def test_equal_names_are_numbered_and_unknown_data_are_not_the_same() -> None:
    known = KnownResults("a", "s", None, FOUND)
    found = compare([known, known])
    assert [one.name for one in found.results] == ["a (1)", "a (2)"] and not found.same_data
    assert compare([replace(known, set_sha256="1"), replace(known, set_sha256="1")]).same_data
    assert "different data" not in " ".join(remarks(found))
    assert "different data" in remarks(compare([replace(known, set_sha256=one) for one in "12"]))[0]


def test_a_fit_is_compared_with_fits_where_all_have_one(small: Any) -> None:
    _, fit = small
    both = KnownResults("both", "s", fit.document(), FOUND)
    of = [
        [one.source for one in compare([both, other]).results]
        for other in (both, KnownResults("a", "s", None, FOUND))
    ]
    assert of == [["identification"] * 2, ["diagnosis"] * 2]
    nothing = compare([both, KnownResults("none", "s")])
    assert nothing.results[1].source == "" and "none: has no result" in remarks(nothing)[0]
    assert ["error, fitted", "joint1"] in [row[:2] for row in texts(numbers(nothing))]
    assert texts(facts(nothing))[3][1:] == [FOUND.final_verdict, "not diagnosed"]


def test_files_sessions_and_sets_in_any_mixture(
    small: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, fit = small
    monkeypatch.chdir(folder)
    monkeypatch.setattr("flexviz.analysis.diagnosis.diagnose", lambda *_, **__: DIAGNOSIS)
    out = tmp_path / "out.json"
    assert main(["compare", "fit.json", "kept", "set", "found.json", "--json", str(out)]) == 0
    document = json.loads(out.read_text())
    assert [one["name"] for one in document["sessions"]] == ["fit.json", "kept", "set", "found.json"]
    row = next(p for p in document["parameters"] if (p["name"], p["joint"]) == ("stiffness", "joint1"))
    assert row["values"][0] == fit["stiffness", "joint1"].value and row["values"][2] == row["values"][3]
    assert "joints" not in document and "removed" not in capsys.readouterr().out  # friction is for two sets
    assert main(["compare", "set", "set", "--json", str(out)]) == 0
    assert "What is left, by the diagnosis of the second set:" in capsys.readouterr().out
    assert {"without", "compensated", "joints", "left", "sessions"} <= json.loads(out.read_text()).keys()


def test_what_was_stopped_is_not_compared(
    small: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(small[0])
    monkeypatch.setattr(
        "flexviz.analysis.diagnosis.diagnose", lambda *_, **__: replace(DIAGNOSIS, stopped=True)
    )
    assert main(["compare", "set", "fit.json", "--json", str(tmp_path / "out.json")]) == 130
    assert not (tmp_path / "out.json").exists()
