"""Reports: what they say, that they need nothing else, and that no text in them becomes markup."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from flexviz.base.errors import InputError
from flexviz.content.records import EffectParameter, GroupError, Note
from flexviz.content.rendering import html, markdown
from flexviz.content.session import Session
from flexviz.content.topics import gather
from flexviz.content.topics.verdict import sentence
from flexviz.content.wording import number
from flexviz.data.measurements import MeasurementSet, read_set
from flexviz.outlets.report import diagnosed_session, session_report
from flexviz.outlets.report.writing import compose
from tests.found import AFTER, BEFORE, COULOMB, DIAGNOSIS, OFFSET
from tests.small_session import small_session
from tests.small_set import TOML, write_small_set

SVG = "{http://www.w3.org/2000/svg}"
VOID = {"meta", "br", "hr", "img", "link", "input"}
BAD = '<script>alert("1")</script>'
Both = tuple[MeasurementSet, Session]


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Both:
    return small_session(tmp_path_factory.mktemp("report") / "small")


@pytest.fixture(scope="module")
def found(both: Both) -> Both:
    """A set that was diagnosed to the end: Coulomb friction added, something unknown left."""
    return both[0], diagnosed_session(both[0], DIAGNOSIS)


class Tags(HTMLParser):
    """Collects tags with their attributes, headings and text; fails where they are not nested."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.headings: list[str] = []
        self.text = ""
        self._open: list[str] = []
        self.feed(text)
        assert not self._open, self._open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data
        if self._open and re.fullmatch(r"h\d", self._open[-1]):
            self.headings.append(data)


def pictures(page: str) -> list[ElementTree.Element]:
    return [ElementTree.fromstring(part) for part in re.findall(r"<svg.*?</svg>", page, re.DOTALL)]


# -- what it says --------------------------------------------------------------------------------------------


def test_it_says_everything_a_diagnosis_found(found: Both) -> None:
    measurements, session = found
    page = Tags(session_report(session, measurements))
    assert page.headings == [
        "What was found about small", "Summary", "How the error fell", "Measured and model torque",
        "Which effects", "Parameters", "Inertias", "Where the model fails",
        "What could not be told apart, and what would decide", "What moves with the observer's bandwidth",
        "To reproduce", "Data and settings", "Again", "History",
    ]  # fmt: skip
    for words in (
        "Added: Coulomb friction on joint2: > 99 % of the error. With it not all",
        "With it not all of the error is explained:",
        "mostly on joint2, where 31 % of it follows the velocity",
        "The error on held-out groups went from ",
        " % of the torque (1.74 Nm) to ",  # sqrt of the mean square of (2.2, 1.1)
        " % of the torque (26.5 mNm).",
        "Before, other parameters had absorbed what was added:",
        "coulomb 3.000 ± 0.020 Nm", "Group g3 (held out: it was not fitted)",
        "motor viscous friction of joint2: 12.00 → 10.10 Nm s/rad",
        "A payload twice as heavy would tell the two apart.",
        "Coulomb friction at the link on joint2",
        "31 % ± 4 % of the residual of joint2 follows its velocity, most of it from 0.200 to 1.00 rad/s.",
        "1987.3 ± 4.1", "not to be trusted", "part is observer error", "15.8 mNm",
        "flexviz report", "sha256sum --check", "numpy", "(validation)",
    ):  # fmt: skip
        assert words in page.text, words
    figures = [h for h in re.findall(r"Figure \d+\. ([^.]*)\.", page.text)]
    assert figures == [
        "Error after each added effect, all joints",
        "The robot",
        "joint1",
        "joint2",
        "Evidence for Coulomb friction on joint2, g1",
        "Residual of joint2 against velocity, 31 %",
        "Spectrum of the residual of joint2",
        "Free torque of joint2 against velocity (not physics)",
    ]


def test_tables_hold_the_numbers(found: Both) -> None:
    measurements, session = found
    text = session_report(session, measurements, "md")
    torque = np.concatenate([group.joined("tau") for group in measurements.groups])

    def told(*rms: float) -> list[str]:
        """In per cent of the joints' torque, and their mean."""
        shares = 100 * np.array(rms) / torque.std(axis=0)
        return [number(value, 3) for value in (*shares, shares.mean())]

    first, last, noise = told(2.2, 1.1), told(0.021, 0.031), told(0.01, 0.02)
    for row in (
        f"| g3 | validate | {first[2]} | {last[2]} |",
        f"| joint2 | {first[1]} | {last[1]} |",
        f"| {noise[1]} % (20.0 mNm) |",
        "| stiffness \\[Nm/rad\\] | 1987.3 ± 4.1 ● | 1987.3 ± 4.1 ● |",
        "| link viscous friction \\[Nm s/rad\\] | ○ | ○ |",  # its interval is wider than its value
        "| motor viscous friction \\[Nm s/rad\\] | 1.10 ± 0.78 ◐ | 1.10 ± 0.78 ◐ |",
        "link viscous friction and motor viscous friction of joints 1 and 2.",
        "| **Added: Coulomb friction** | joint2 | coulomb 3.000 ± 0.020 Nm | \\> 99 % | 98 % |",
        "| model 0 | Torque offset on joint1 | offset 0.40 ± 0.39 Nm | 11 % | 2 % |",
        f"| joint2 | {last[1]} % | 0 % | **31 %** | 4 % | 2 % | 3 % | **5 %** | **6 %** | **7 %** |",
        "| stiffness | joint2 | 1987 | 1400 | 1987 | Nm/rad | 280 | **not to be trusted** |",
    ):
        assert row in text, row


def test_json_is_for_programs(found: Both) -> None:
    measurements, session = found
    document = json.loads(session_report(session, measurements, "json"))
    assert document["summary"].startswith("Added: Coulomb friction on joint2")
    assert [step["added"] for step in document["staircase"]] == [[], ["coulomb_friction:joint2"]]
    assert document["staircase"][1]["rms_validation"] == [0.021, 0.031]
    assert document["diagnosis"]["verdict"] == "unknown" and document["identification"] is None
    assert document["added"][0]["finding"]["score"] == 0.62
    assert document["guard"]["parameters"][1]["values"] == [1400.0, None, 1987.3]
    assert document["guard"]["joints"][1]["observer_error"] is True
    assert len(document["set"]["files"]) == 5 and len(document["set"]["sha256"]) == 64
    assert "A payload twice as heavy" in document["next_experiments"][0]
    std = {p["name"]: p["std"] for p in document["diagnosis"]["model"]["parameters"]}
    assert std["link_viscous_friction"] is None  # infinite


def test_a_diagnosed_set_is_a_session_with_a_state_a_step(found: Both) -> None:
    measurements, session = found
    assert [step.label for step in session.steps] == [
        "opened small", "looked for the missing effect", "added Coulomb friction on joint2"
    ]  # fmt: skip
    first, last = session.past[-1].analysis.diagnosis, session.analysis.diagnosis
    assert first is not None and last is not None
    assert (
        [one.text for one in first.findings] == [COULOMB.text, OFFSET.text]
        and first.steps == (BEFORE,)
        and not first.maps
    )
    assert last.findings == () and last.steps == (AFTER,) and last.maps == DIAGNOSIS.maps
    assert (first.verdict, last.verdict) == ("missing", "unknown")
    subject = gather(session, measurements)
    (added,) = subject.added
    assert added == ("coulomb_friction:joint2", first.findings[0]) and session.analysis.diagnosis_up_to_date


@pytest.mark.parametrize(
    "verdict, words",
    [
        ("nothing-missing", "With it nothing is missing: the residual looks like noise"),
        ("missing", "With it this is still missing: "),
    ],
)
def test_the_sentence_follows_the_last_verdict(both: Both, verdict: str, words: str) -> None:
    last = replace(AFTER, verdict=verdict)
    session = diagnosed_session(both[0], replace(DIAGNOSIS, steps=(BEFORE, last)))
    assert words in sentence(gather(session, both[0]))


# -- sessions that hold less ---------------------------------------------------------------------------------


def test_a_session_that_begins_says_so(both: Both) -> None:
    measurements = both[0]
    for kind in ("html", "md", "json"):
        session_report(Session.of(measurements), measurements, kind)
    page = Tags(session_report(Session.of(measurements), measurements))
    assert "Not diagnosed yet" in page.text and "Parameters" not in page.headings
    assert "To reproduce" in page.headings


def test_an_identified_one_shows_its_parameters_and_how_to_get_them(both: Both) -> None:
    measurements, session = both
    session = session.undo().undo()  # identified, not diagnosed
    text = session_report(session, measurements, "md", folder=Path("/home/me/a session"))
    assert "butterworth\\-zero" not in text and "observer butterworth-zero-phase" in text
    assert "combinations of inertial parameters" in text and "flexviz.identify(" in text
    assert "flexviz report '/home/me/a session' --out report.html" in text
    program = re.findall(r"```python\n(.*?)```", text, re.DOTALL)[0]
    compile(program, "program", "exec")


def test_out_of_date_results_are_not_shown(both: Both) -> None:
    measurements, session = both  # an effect was added since
    page = Tags(session_report(session, measurements))
    assert "changed since the last diagnosis" in page.text and "Which effects" not in page.headings
    assert "changed since the last identification" in page.text and "Parameters" not in page.headings


def test_changed_data_and_early_stops_are_said_first(found: Both) -> None:
    measurements, session = found
    stopped = diagnosed_session(measurements, replace(DIAGNOSIS, stopped=True))
    assert "stopped early" in session_report(stopped, measurements)
    analysis = replace(session.analysis, diagnosed=None)
    old = replace(session, present=replace(session.present, analysis=analysis))
    page = session_report(old, measurements, changed=("a.csv",))
    assert "The data have changed since:" in page and "Coulomb friction on joint2" in page


def test_without_guard_or_maps_it_says_how_to_get_them(both: Both) -> None:
    less = replace(DIAGNOSIS, guard=None, maps=(), free_curve=None)
    page = Tags(session_report(diagnosed_session(both[0], less), both[0]))
    assert "the option --guard" in page.text and "Where the model fails" not in page.headings


def test_an_unknown_kind(both: Both) -> None:
    with pytest.raises(InputError, match="html, md, json"):
        session_report(both[1], both[0], "pdf")


# -- one file, nothing else ----------------------------------------------------------------------------------


def test_the_page_needs_nothing_and_runs_nothing(found: Both) -> None:
    page = Tags(session_report(found[1], found[0]))
    assert not {"script", "link", "iframe", "object", "img"} & {tag for tag, _ in page.tags}
    for tag, attributes in page.tags:
        assert not {"src", "href", "onload", "onclick", "srcset", "action"} & attributes.keys(), tag
    raw = session_report(found[1], found[0])
    assert "url(http" not in raw and "@import" not in raw and "Content-Security-Policy" in raw
    assert set(re.findall(r"https?://[^\s\"'<]+", raw)) == {"http://www.w3.org/2000/svg"}
    assert "@media print" in raw and "size: A4" in raw and '<html lang="en">' in raw


def test_every_picture_can_be_read_aloud_and_lies_within_its_frame(found: Both) -> None:
    page = session_report(found[1], found[0])
    drawn = pictures(page)
    assert len(drawn) == 8
    ids = re.findall(r'id="([^"]+)"', page)
    assert len(ids) == len(set(ids))
    for picture in drawn:
        width, height = (float(v) for v in picture.attrib["viewBox"].split()[2:])
        title, description = (picture.find(f"{SVG}{name}") for name in ("title", "desc"))
        assert title is not None and description is not None and title.text and description.text
        assert picture.attrib["role"] == "img" and len(picture.attrib["aria-labelledby"].split()) == 2
        for line in picture.iter(f"{SVG}polyline"):
            points = np.array([pair.split(",") for pair in line.attrib["points"].split()], dtype=float)
            assert np.isfinite(points).all()
            assert (points >= -0.5).all() and (points <= [width + 0.5, height + 0.5]).all()
        for text in picture.iter(f"{SVG}text"):
            assert 0 <= float(text.attrib["x"]) <= width and float(text.attrib["y"]) <= height
    assert all(row.attrib.get("scope") is None for row in drawn[0])
    assert 'scope="col"' in page and page.count("<caption>") >= 6


# -- no text becomes markup ----------------------------------------------------------------------------------


def hostile(folder: Path) -> MeasurementSet:
    """The small set with names that would break a page or a table."""
    write_small_set(folder)
    bad = BAD.replace('"', "'")
    toml = TOML.replace('name = "g1"', f'name = "{bad}"').replace(
        'trajectory = "t2"', 'trajectory = "a|b`*_"'
    )
    (folder / "measurements.toml").write_text(toml)
    return read_set(folder)


def test_names_notes_and_results_are_only_text(tmp_path: Path) -> None:
    measurements = hostile(tmp_path / "<i>set & more")
    finding: Any = replace(
        COULOMB,
        inseparable_from=(replace(COULOMB.inseparable_from[0], joint=BAD, breaks=BAD),),
        parameters={BAD: EffectParameter(1.0, 0.1, BAD)},
        absorbed=(replace(COULOMB.absorbed[0], joint=BAD, unit=BAD),),
    )
    parameters = tuple(replace(p, unit=BAD, tied_to=(BAD,)) for p in DIAGNOSIS.parameters)
    steps = (BEFORE, replace(AFTER, added=finding, groups=(GroupError(BAD, (1.0, 2.0), True),)))
    diagnosis = replace(
        DIAGNOSIS, findings=(finding,), notes=(Note("other", BAD),), parameters=parameters, steps=steps,
        maps=tuple(replace(m, unit=BAD, curves=tuple(BAD for _ in m.curves)) for m in DIAGNOSIS.maps),
    )  # fmt: skip
    session = diagnosed_session(measurements, diagnosis).with_note(BAD).with_recording(Path(f"/{BAD}"))
    for kind in ("html", "md", "json"):
        text = session_report(session, measurements, kind, folder=tmp_path / BAD, changed=(BAD,))
        assert "alert" in text
        if kind == "html":
            page = Tags(text)
            tags = {tag for tag, _ in page.tags}
            assert not {"script", "i", "img"} & tags and BAD in page.text
            assert len(pictures(text)) == 6
        elif kind == "md":
            plain = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
            assert not re.search(r"(?<!\\)<", plain)
            rows = [line for line in plain.splitlines() if line.startswith("|")]
            assert rows and all(re.fullmatch(r"\|.*\|", row) for row in rows)
            assert any(r"a\|b\`\*\_" in row for row in rows)
        else:
            json.loads(text)


def test_the_document_is_the_same_in_both_languages(found: Both) -> None:
    document = compose(gather(found[1], found[0]), "today")
    page, text = Tags(html(document)).text, markdown(document)
    text = text.replace("\\", "")
    for words in ("Parameters of joints and effects", "Worth recording next:", "hardly distinguish", "today"):
        assert words in page and words in text
