"""Step Diagnose without a browser: find, add, the error falls, undo, remove, add all, stop."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from flexviz.app import DEMO
from flexviz.app.application import Application
from flexviz.app.work import open_set
from flexviz.diagnosis import diagnose
from flexviz.identification import identify
from flexviz.measurements import read_set
from flexviz.resources import sessions_dir
from flexviz.view.status import error_text
from tests.app_running import running
from tests.test_app import act, status, until

pytestmark = pytest.mark.slow
EFFECT = "coulomb_friction:joint2"


@pytest.fixture(scope="module")
def app(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Application]:
    with running(tmp_path_factory.mktemp("diagnose"), sessions_dir() / DEMO) as application:
        yield application


def wait(app: Application) -> None:
    until(app, lambda: not app.running)


def test_find_add_undo_remove(app: Application) -> None:
    measurements = read_set(sessions_dir() / DEMO)
    assert app.dock._undo.disabled and app.dock._redo.disabled and app.dock._stop.disabled
    assert "Find the missing effect" in app.dock._line.content
    act(app, "step", "Diagnose")
    act(app, "find")
    assert (
        app.running and app.diagnose._find.disabled and not app.dock._stop.disabled and app.dock._bar.visible
    )
    wait(app)
    first = app.session.analysis
    assert first.identification is not None and first.diagnosis_up_to_date
    assert app.diagnose._verdict.content.find("Missing: Coulomb friction on joint2") > 0
    assert error_text(identify(measurements)) in status(app)
    best = app.diagnose.findings._places[0]
    assert best.add.visible and "coulomb 3.0" in best._text.content and "Automatica" in best._card.content
    assert "Add and refit" in app.dock._line.content

    act(app, "add0")
    wait(app)
    added = app.session.analysis
    assert added.effects == (EFFECT,) and added.up_to_date and added.diagnosis_up_to_date
    assert error_text(identify(measurements, effects=(EFFECT,))) in status(app)
    assert "Nothing is missing" in app.diagnose._verdict.content and not best.add.visible
    answer = diagnose(measurements)
    for stair, step in zip(added.model_steps, answer.steps, strict=True):
        assert np.allclose(stair.step.rms, step.rms, rtol=0.02)
        assert np.allclose(stair.step.rms_validation, step.rms_validation, rtol=0.02)  # type: ignore[arg-type]
    model_steps = app.show.plots._compare._charts["all"]._handle.data
    assert model_steps[1][0] > 20 * model_steps[1][-1]
    assert "Coulomb friction on joint2" in app.show.plots._steps.content

    act(app, "undo")
    assert not app.running  # nothing is computed again
    assert app.session.analysis is first and "Missing:" in app.diagnose._verdict.content
    assert not app.dock._redo.disabled and "added Coulomb friction" in str(app.dock._redo.hint)
    act(app, "redo")
    assert app.session.analysis is added and app.dock._redo.disabled

    act(app, "remove0")
    wait(app)
    assert app.session.analysis.effects == () and "Missing:" in app.diagnose._verdict.content
    assert len(app.session.analysis.model_steps) == 1


def test_add_all_is_a_history_of_steps(app: Application) -> None:
    app.open(open_set(sessions_dir() / DEMO))
    act(app, "add-all")
    wait(app)
    assert app.session.analysis.effects == (EFFECT,)
    assert [step.label for step in app.session.past][-1] == "looked for the missing effect"
    assert "Nothing is missing" in app.diagnose._verdict.content
    act(app, "undo")
    assert app.session.analysis.effects == () and "Missing:" in app.diagnose._verdict.content


def test_a_stopped_search_changes_nothing(app: Application) -> None:
    app.open(open_set(sessions_dir() / DEMO))
    act(app, "find")
    act(app, "stop")
    wait(app)
    assert app.session.analysis.diagnosis is None and "stopped" in status(app)
    assert not app.diagnose._find.disabled and app.dock._undo.disabled


def test_a_change_meanwhile_wins(app: Application) -> None:
    app.open(open_set(sessions_dir() / DEMO))
    act(app, "find")
    act(app, "role0", "Ignore")
    wait(app)
    assert app.session.analysis.diagnosis is None and "changed meanwhile" in status(app)
