"""A topic of content is one class: terminal, Python, notebook, report, recording and app say what it says."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from flexviz.content.blocks import Block, Items, TableBlock, table, warning
from flexviz.content.results import ResultDocument
from flexviz.content.topics import TOPICS, Story, Topic, ordered
from flexviz.content.topics.topic import REPORT
from flexviz.outlets.app.steps.diagnose import DiagnoseStep
from flexviz.outlets.recording.texts import diagnosis_text
from flexviz.outlets.report import diagnosed_session, session_report
from flexviz.outlets.terminal.terminal import show
from tests.app_running import running
from tests.found import DIAGNOSIS
from tests.small_session import small_session
from tests.small_set import write_small_set


class Wear(Topic):
    """A number per joint, which nothing else knows."""

    name = "wear"
    title = "Wear"

    def blocks(self, result: ResultDocument) -> Iterator[Block]:
        """A warning and a table."""
        yield warning("The grease of joint2 is <old>.")
        yield table(("joint", "hours"), [["joint2", "4711"]], (1,))

    def numbers(self, story: Story) -> Any:
        """The table."""
        return {"joint2": 4711}


@pytest.fixture(autouse=True)
def wear(monkeypatch: pytest.MonkeyPatch) -> None:
    """What `register` does, for one test."""
    monkeypatch.setitem(TOPICS, Wear.name, Wear())


def test_terminal_python_notebook_and_recording(capsys: pytest.CaptureFixture[str]) -> None:
    show(DIAGNOSIS.document())
    for text in (capsys.readouterr().out, DIAGNOSIS.summary(80)):
        assert "The grease of joint2 is <old>." in text and "4711" in text
    for text in (DIAGNOSIS._repr_html_(), diagnosis_text(DIAGNOSIS)):
        assert "The grease of joint2 is " in text and "<old>" not in text and "4711" in text


def test_report_and_its_json(tmp_path: Path) -> None:
    measurements, _ = small_session(tmp_path / "small")
    session = diagnosed_session(measurements, DIAGNOSIS)
    page, text = (session_report(session, measurements, kind) for kind in ("html", "md"))
    assert "<h2>Wear</h2>" in page and "is &lt;old&gt;." in page and "| joint2 | 4711 |" in text
    document = json.loads(session_report(session, measurements, "json"))
    assert document["wear"] == {"joint2": 4711} and document["acceptance"] is None


def test_app(tmp_path: Path) -> None:
    with running(tmp_path, write_small_set(tmp_path / "small")) as app:
        (step,) = (step for step in app.dock.steps if isinstance(step, DiagnoseStep))
        found = replace(DIAGNOSIS, set_name="small")
        app.store.change("looked", app.store.analysis.with_diagnosis(found))
        app.once(0.0)
        assert 'class="fv-warn">The grease of joint2 is &lt;old&gt;.' in step.more.content
        assert "<td>4711</td>" in step.more.content


def test_every_topic_has_its_place() -> None:
    known = [topic.name for topic in ordered() if topic.name != Wear.name]
    assert known == REPORT


def test_every_joint_and_candidate_of_a_result_has_its_row() -> None:
    said = {topic.name: list(topic.blocks(DIAGNOSIS.document())) for topic in ordered()}
    (candidates,) = (block for block in said["added"] if isinstance(block, Items))
    assert len(candidates.items) == len(DIAGNOSIS.findings) and candidates.ranked
    (errors,) = (block for block in said["staircase"] if isinstance(block, TableBlock))
    assert [row[0].text for row in errors.rows] == ["joint1", "joint2"]
    assert len(errors.head) == 1 + len(DIAGNOSIS.steps) + 3
