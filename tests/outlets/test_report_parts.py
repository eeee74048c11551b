"""The report's charts and its command."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from flexviz.analysis.diagnosis import Diagnosis
from flexviz.content.charts import Chart, ChartAxis, ChartSeries, Ribbon
from flexviz.content.charts.svg import draw_svg, log_ticks, stretches, ticks
from flexviz.content.records import EffectParameter
from flexviz.content.session import Session, diagnosed_models, is_session, open_session, save_session
from flexviz.content.topics.staircase import columns
from flexviz.data.measurements import read_set
from flexviz.outlets.report import diagnosed_session, session_report
from flexviz.outlets.terminal import main
from tests.found import AFTER, BEFORE, COULOMB, DIAGNOSIS, GUARD, OFFSET, TIED_DIAGNOSIS
from tests.small_session import small_session
from tests.small_set import write_small_set

SVG = "{http://www.w3.org/2000/svg}"


# -- charts --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "low, high, texts",
    [
        (0.0, 1.0, ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]),
        (-3e-7, 2e-7, ["−3e−07", "−2e−07", "−1e−07", "0", "1e−07", "2e−07"]),
        (0.0, 4e6, ["0", "1e+06", "2e+06", "3e+06", "4e+06"]),
        (999.0, 1001.0, ["999.0", "999.5", "1000.0", "1000.5", "1001.0"]),
    ],
)
def test_ticks_are_round_and_within(low: float, high: float, texts: list[str]) -> None:
    found = ticks(low, high, 5)
    assert [text for _, text in found] == texts
    assert all(low - 1e-9 <= value <= high + 1e-9 for value, _ in found)


def test_ticks_of_a_logarithmic_axis() -> None:
    assert [text for _, text in log_ticks(-2.1, 0.1)] == ["0.01", "0.02", "0.05", "0.1", "0.2", "0.5", "1"]
    many = log_ticks(-9.0, 6.0)
    assert 3 <= len(many) <= 9 and all(np.log10(value) % 1 == 0 for value, _ in many)


def test_lines_are_interrupted_where_nothing_is_known() -> None:
    x, y = np.arange(7.0), np.array([np.nan, 1.0, 2.0, np.inf, 1.0, np.nan, 3.0])
    assert [list(rows) for rows in stretches(x, y)] == [[1, 2], [4], [6]]
    picture = ElementTree.fromstring(draw_svg(chart(ChartSeries("a", "#0072B2", x, y)), "k"))
    lines = [e for e in picture.iter(f"{SVG}polyline") if len(e.attrib["points"].split()) > 0]
    assert len(lines) == 3 + 1  # and its place in the legend


def chart(*series: ChartSeries, logarithmic: bool = False, **more: Any) -> Chart:
    axes = ChartAxis("x"), ChartAxis("y", logarithmic=logarithmic)
    return Chart("key", "title", *axes, series, description="words", height=260, **more)


def test_a_chart_without_a_finite_value_is_drawn_all_the_same() -> None:
    empty = ChartSeries("nothing", "#0072B2", np.arange(3.0), np.full(3, np.nan))
    for logarithmic in (False, True):
        ElementTree.fromstring(draw_svg(chart(empty, logarithmic=logarithmic), "k"))
    flat = ChartSeries("flat", "#0072B2", np.zeros(3), np.full(3, 5.0))
    ribbon = Ribbon("ribbon", "#999999", np.zeros(3), np.full(3, 4.0), np.full(3, 6.0))
    text = draw_svg(chart(flat, ribbons=(ribbon,), highlights=((-1.0, 1.0),)), "k")
    assert "nan" not in text and "inf" not in text


def test_a_long_legend_takes_more_rows_and_long_names_are_cut() -> None:
    x = np.arange(3.0)
    curves = [ChartSeries(f"{'long' * 20}{i}", "#0072B2", x, x) for i in range(6)]
    picture = ElementTree.fromstring(draw_svg(chart(*curves), "k"))
    places = [
        (float(e.attrib["x"]), float(e.attrib["y"]))
        for e in picture.iter(f"{SVG}text")
        if (e.text or "").startswith("long")
    ]
    assert len(set(places)) == 6 and len({y for _, y in places}) > 1
    assert all((e.text or "").endswith("…") for e in picture.iter(f"{SVG}text") if "long" in (e.text or ""))
    assert float(picture.attrib["viewBox"].split()[3]) > 260 + 20


def test_a_table_has_room_for_the_first_and_the_last_models() -> None:
    assert columns(3, 7) == [0, 1, 2] and columns(20, 7) == [0, 14, 15, 16, 17, 18, 19]


# -- the command ---------------------------------------------------------------------------------------------


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write_small_set(tmp_path / "small")
    return tmp_path


def answering(monkeypatch: pytest.MonkeyPatch, answer: Diagnosis | None) -> list[dict[str, Any]]:
    """Have the diagnosis answer at once; None: it must not be asked."""
    asked: list[dict[str, Any]] = []

    def diagnose(measurements: Any, **options: Any) -> Diagnosis:
        assert answer is not None, "computed again what is saved"
        asked.append({"effects": measurements.effects, **options})
        return answer

    monkeypatch.setattr("flexviz.outlets.workflows.diagnose", diagnose)
    return asked


def test_a_sets_report_and_the_same_again_from_its_session(
    workplace: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = answering(monkeypatch, DIAGNOSIS)
    assert main(["report", "small", "--out", "a.html", "--session", "kept", "--guard"]) == 0
    assert asked[0]["apply"] is True and asked[0]["guard"] is True
    assert capsys.readouterr().out.startswith("a.html: ")
    answering(monkeypatch, None)
    for name in ("b.html", "b.md", "b.json"):
        assert main(["report", "kept", "--out", name]) == 0
    stamp = re.compile(r"\d{4}-\d\d-\d\d.\d\d:\d\d:\d\d")
    first, second = (stamp.sub("", (workplace / n).read_text()) for n in ("a.html", "b.html"))
    assert first == second and f"flexviz report {workplace / 'kept'} --out report.html" in first
    assert json.loads((workplace / "b.json").read_text())["session"] == str(workplace / "kept")
    assert is_session(workplace / "kept") and not list(workplace.glob(".*"))


def test_a_session_gets_computed_only_what_it_does_not_hold(
    workplace: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    measurements, session = small_session(workplace / "other")
    save_session(session, measurements, workplace / "kept")  # an effect was added since the diagnosis
    asked = answering(monkeypatch, replace(DIAGNOSIS, guard=None, steps=DIAGNOSIS.steps[:1]))
    assert main(["report", "kept", "--out", "a.md", "--session", "more"]) == 0
    assert asked[0]["apply"] is False and asked[0]["effects"] == ("coulomb_friction", "torque_offset:joint1")
    answering(monkeypatch, None)
    looked: list[Any] = []
    monkeypatch.setattr(
        "flexviz.outlets.workflows.bandwidth_checked", lambda *args: looked.append(args) or GUARD
    )
    assert main(["report", "more", "--out", "b.md"]) == 0 and not looked
    assert "the option --guard" in (workplace / "b.md").read_text()
    assert main(["report", "more", "--out", "b.md", "--guard"]) == 0 and len(looked) == 1
    assert "not to be trusted" in (workplace / "b.md").read_text()
    assert open_session(workplace / "kept").session.redoes == "width"  # nothing was written into it


def test_a_stopped_diagnosis_is_reported_with_its_exit_code(
    workplace: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    answering(monkeypatch, replace(DIAGNOSIS, stopped=True))
    assert main(["report", "small", "--out", "a.html"]) == 130
    assert "stopped early" in (workplace / "a.html").read_text()


def test_changed_data_are_not_diagnosed_silently(
    workplace: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    answering(monkeypatch, DIAGNOSIS)
    assert main(["report", "small", "--out", "a.html", "--session", "kept"]) == 0
    table = workplace / "small" / "a.csv"
    table.write_text(table.read_text().replace("\n0,", "\n0.0,", 1))
    answering(monkeypatch, None)
    assert main(["report", "kept", "--out", "b.html"]) == 0
    assert "a.csv" in capsys.readouterr().err
    assert "The data have changed since:</b> a.csv." in (workplace / "b.html").read_text()


@pytest.mark.parametrize(
    "arguments, said",
    [
        (["small", "--out", "a.pdf"], '".pdf" is not a kind of report; valid: .html, .htm, .md, .json'),
        (["small", "--out", "html"], '"html" is not a kind of report'),
        (["small", "--out", "no/a.html"], "does not exist"),
        (["small", "--out", "small.html"], "is a folder"),
        (["none", "--out", "a.html"], "none"),
        (["small", "--out", "a.html", "--session", "small"], "is not empty"),
    ],
)
def test_bad_use_is_one_line_and_leaves_nothing(
    workplace: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    said: str,
) -> None:
    answering(monkeypatch, None)
    (workplace / "small.html").mkdir()
    assert main(["report", *arguments]) == 2
    error = capsys.readouterr().err.splitlines()[-1]
    assert said in error and error.startswith("flexviz: ")
    assert sorted(file.name for file in workplace.iterdir()) == ["small", "small.html"]


# -- compare and session -------------------------------------------------------------------------------------


def test_sessions_are_compared(
    workplace: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    answering(monkeypatch, DIAGNOSIS)
    assert main(["report", "small", "--out", "a.md", "--session", "one"]) == 0
    stiffer = tuple(
        replace(p, value=p.value + 20) if p.name == "stiffness" else p for p in DIAGNOSIS.parameters
    )
    answering(monkeypatch, replace(DIAGNOSIS, parameters=stiffer))
    assert main(["report", "small", "--out", "a.md", "--session", "two"]) == 0
    capsys.readouterr()
    assert main(["compare", "one", "two", "--json", "c.json"]) == 0
    out = capsys.readouterr().out
    assert "1987.3 ± 4.1" in out and "2007.3 ± 4.1" in out and "6.7 !" in out and "differ by 3" in out
    assert "mass" not in out and "unknown" in out and "different data" not in out
    document = json.loads((workplace / "c.json").read_text())
    row = next(p for p in document["parameters"] if p["name"] == "stiffness")
    assert row["values"] == [1987.3, 2007.3] and row["deviations"] == pytest.approx(20 / (2.1 * 2**0.5))
    assert document["same_data"] and document["sessions"][0]["rms_validation"] == [0.021, 0.031]
    assert main(["compare", "one", "two", "--all"]) == 0 and "mass" in capsys.readouterr().out
    for bad in (["one"], ["one", "none"], ["one", "c.json"]):
        assert main(["compare", *bad]) == 2
    measurements, session = small_session(workplace / "other")
    save_session(session, measurements, workplace / "three")
    capsys.readouterr()
    assert main(["compare", "one", "three"]) == 0
    out = capsys.readouterr().out
    assert "three: has no result for its current settings." in out and "different" not in out
    identified = session.undo().undo()
    save_session(identified, measurements, workplace / "three")
    assert main(["compare", "one", "three", "--json", "c.json"]) == 0
    out = capsys.readouterr().out
    assert "different kinds of fit" in out
    found = identified.analysis.identification
    document = json.loads((workplace / "c.json").read_text())["sessions"][1]
    assert found is not None and document["rms"] == list(found.residual.rms)
    assert document["source"] == "identification" and document["observer"] == found.observer_name
    save_session(Session.of(measurements), measurements, workplace / "three")
    assert open_session(workplace / "three").session.past == ()


def test_a_session_is_shown_annotated_and_finds_its_data_again(
    workplace: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (workplace / "data").mkdir()
    measurements, session = small_session(workplace / "data" / "other")
    save_session(session.with_recording(workplace / "gone.rrd"), measurements, workplace / "kept")
    assert main(["session", "kept", "--note", "cold start"]) == 0
    out = capsys.readouterr().out
    for words in ("unchanged", "4. 20", "offset", "1 undone", "cold start", "gone.rrd (missing)", "verdict"):
        assert words in out, words
    (workplace / "data" / "other").rename(workplace / "moved")
    assert main(["session", "kept"]) == 2 and "--set" in capsys.readouterr().err
    assert main(["session", "kept", "--set", "moved"]) == 0
    assert main(["session", "kept"]) == 0 and "cold start" in capsys.readouterr().out
    assert main(["session", "moved"]) == 2


def test_effects_of_one_kind_are_one_part_with_a_value_per_joint(tmp_path: Path) -> None:
    measurements = read_set(write_small_set(tmp_path / "small"))
    first = replace(COULOMB, joint="joint1", parameters={"coulomb": EffectParameter(7.0, 0.02, "Nm")})
    both = replace(AFTER, added=first, rms_validation=(0.02, 0.3))
    offset = replace(AFTER, added=OFFSET, rms_validation=(0.011, 0.029))
    found = replace(DIAGNOSIS, findings=(COULOMB, first, OFFSET), steps=(BEFORE, AFTER, both, offset))
    models = diagnosed_models(found, measurements.joints)
    assert [model.effects for model in models] == [
        (), ("coulomb_friction:joint2", "coulomb_friction:joint1"), ("torque_offset:joint1",),
    ]  # fmt: skip
    assert [model.diagnosis.steps for model in models] == [(BEFORE,), (both,), (offset,)]
    findings = [model.diagnosis.findings for model in models]
    assert [[one.text for one in each] for each in findings] == [
        [one.text for one in found.findings], ["torque_offset:joint1"], [],
    ]  # fmt: skip
    shares = [one.share or 0.0 for one in findings[0]]
    assert sum(shares) <= 1.0 and shares[0] > shares[2] > 0.0
    assert models[-1].diagnosis.maps and not models[1].diagnosis.maps

    session = diagnosed_session(measurements, found)
    assert [step.label for step in session.steps][1:] == [
        "looked for the missing effect",
        "added Coulomb friction on joints 1 and 2",
        "added Torque offset on joint1",
    ]
    text = session_report(session, measurements, "md")
    assert "| **Added: Torque offset** | joint1 |" in text
    assert (
        "Added: Coulomb friction on joints 1 and 2: 96 % of the error; Torque offset on joint1: 4 % of the "
        "error. With them not all of the error is explained"
    ) in text
    assert "| **Added: Coulomb friction** | joint1 | coulomb 7.000 ± 0.039 Nm | 96 % | 98 % |" in text
    assert "|   | joint2 | coulomb 3.000 ± 0.020 Nm |   | 98 % |" in text
    assert text.count("absorbed") == 1  # listed once, briefly
    assert "What is left: joint2" in text and "1 adds Coulomb friction on joints 1 and 2; 2 adds" in text
    assert "model 3" not in text and "Candidates" not in text  # all were added


def test_a_report_names_the_family_where_the_data_do_not_tell_its_members_apart(tmp_path: Path) -> None:
    measurements = read_set(write_small_set(tmp_path / "small"))
    untold = "these data do not tell which kind"
    session = diagnosed_session(measurements, TIED_DIAGNOSIS)
    assert session.present.label == "added Dry friction on joint2"
    text = session_report(session, measurements, "md")
    assert f"Added: Dry friction on joint2 ({untold}): \\> 99 % of the error." in text
    assert "| **Added: Dry friction** | joint2 |" in text and "| 97 % |" in text
    assert "Alike in these data: Coulomb friction and Coulomb friction at the link." in text
    assert "1 adds Dry friction on joint2" in text and "added Dry friction on joint2." in text
    # proposed, not yet added
    proposed = diagnosed_session(measurements, replace(TIED_DIAGNOSIS, steps=(BEFORE,)))
    text = session_report(proposed, measurements, "md")
    assert "Alike in these data: Coulomb friction and" in text
    assert "| **Proposed: Dry friction** | joint2 | coulomb 3.000 ± 0.020 Nm |" in text


def test_a_report_warns_of_values_at_their_bound(tmp_path: Path) -> None:
    measurements = read_set(write_small_set(tmp_path / "small"))
    low = tuple(
        replace(p, value=1e-3, start=1.0) if p.name == "motor_inertia" else p for p in DIAGNOSIS.parameters
    )
    text = session_report(
        diagnosed_session(measurements, replace(DIAGNOSIS, parameters=low)), measurements, "md"
    )
    assert "this torque was probably measured behind the gear" in text


def test_a_report_tells_why_these_effects(tmp_path: Path) -> None:
    measurements = read_set(write_small_set(tmp_path / "small"))
    session = diagnosed_session(measurements, TIED_DIAGNOSIS)
    assert session.past[-1].analysis.diagnosis is not None and not session.past[-1].analysis.diagnosis.trace
    text = session_report(session, measurements, "md")
    part = text[text.index("## Why these effects: what was tried") :].split("\n## ")[0]
    assert "| **Dry friction on joint2 added** | 400 ± 12 | coarse | accepted |" in part
    assert "| Torque offset on joint1 not added | 1.5 ± 1.0 | fine | within its error |" in part
    assert "Of 40 decoys none was accepted: candidates that cannot be right" in part
    assert "Why these effects" in session_report(session, measurements, "html")
    without = diagnosed_session(measurements, DIAGNOSIS)
    assert "Why these effects" not in session_report(without, measurements, "md")
