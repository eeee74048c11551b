"""Step Diagnose without a browser: find, add, the error falls, undo, remove, add all, stop."""

from __future__ import annotations

import io
import math
import re
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexviz.analysis.diagnosis import Diagnosis, Step, prediction_errors
from flexviz.analysis.identification import identify
from flexviz.base.resources import sessions_dir
from flexviz.content.records import FreeCurve
from flexviz.content.session import identified_errors, open_session, save_session
from flexviz.content.topics import gather
from flexviz.content.topics.verdict import numbers
from flexviz.content.view import model_curve_charts, staircase_charts
from flexviz.content.wording import number
from flexviz.outlets.app import DEMO
from flexviz.outlets.app.application import Application, first_step
from flexviz.outlets.app.sets import open_set
from flexviz.outlets.app.steps.data import DataStep
from flexviz.outlets.app.steps.deciding import DECIDE, DOWNLOAD
from flexviz.outlets.app.steps.diagnose import DiagnoseStep
from flexviz.outlets.app.tasks import JudgeErrors, open_fitted
from flexviz.outlets.report import session_report
from tests.app_running import control, off, reopen, running, send, shown, status, until, use, wait
from tests.found import COULOMB, DIAGNOSIS, OFFSET, TIED_DIAGNOSIS

EFFECT = "coulomb_friction:joint2"


@pytest.fixture(scope="module")
def app(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Application]:
    with running(tmp_path_factory.mktemp("diagnose"), sessions_dir() / DEMO) as application:
        yield application


def diagnose_step(app: Application) -> DiagnoseStep:
    return next(step for step in app.dock.steps if isinstance(step, DiagnoseStep))


def one_error_everywhere(app: Application) -> None:
    """Status line, table, staircase and report state one error of the model that is shown."""
    said = re.search(r"validation error ([\d.]+) % of the torque, most on (joint\d): ([\d.]+) %", status(app))
    assert said, status(app)
    share = float(said[1])
    rows = re.findall(r"<tr><td>.*?</tr>", shown(app, "fv-stair"))
    held_out = re.findall(r">([\d.]+)</td>", rows[len(app.store.analysis.model_steps) - 1])[-1]
    assert float(held_out) == pytest.approx(share, rel=0.05)
    *_, validation = (line for line in staircase_charts(app.store.analysis.model_steps, 0, ("a", "b"),
        app.store.measurements.torque_spread)[0].series if "validation" in line.label)  # fmt: skip
    assert validation.y[-1] == pytest.approx(share, rel=0.05)
    content = gather(app.store.session, app.store.measurements)
    tile = next(tile for tile in numbers(content) if tile.label == "Error")
    assert tile.value.removesuffix(" %").split(" → ")[-1] == said[1]
    # the largest one is that of its link
    legend = re.sub(r"<[^>]*>|◂", " ", shown(app, "fv-joints")).split()
    assert legend[legend.index(said[2]) + 1] == said[3]
    # and nearly what identification alone gives: no other band, whatever the observer
    analysis = app.store.analysis
    if analysis.identification is not None and analysis.identification.refined:
        plain = identify(app.store.measurements, analysis.fit, refine=False)
        analysis = analysis.with_identification(plain, analysis.settings)
    errors = identified_errors(app.store.measurements, analysis)
    assert errors is not None and errors.rms_validation is not None
    found = 100 * np.divide(errors.rms_validation, app.store.measurements.torque_spread).mean()
    assert found == pytest.approx(share, rel=0.05)


def test_the_example_opens_identified_and_wrong(app: Application) -> None:
    opened = open_fitted(sessions_dir() / DEMO)
    assert first_step(opened) == "Diagnose" and first_step(open_set(sessions_dir() / DEMO)) == "Data"
    app.store.open(opened)
    assert app.store.joint_name == "joint2" and off(app, "Undo")  # nothing to undo
    said = re.search(r"wrong by (\d+) % on joint2", shown(app, "fv-wrong"))
    result, errors = app.store.analysis.identification, app.store.errors
    assert said and result is not None and errors is not None  # at once, by no idle work
    judging = JudgeErrors.of(app.store.analysis)
    assert judging and errors.rms_validation == judging.run()[0].rms_validation
    expected = 100 * errors.rms_validation[1] / app.store.measurements.torque_spread[1]  # type: ignore[index]
    assert float(said[1]) == pytest.approx(expected, abs=0.5)
    truth = identify(app.store.measurements)
    assert np.allclose(result.model.stiffness, truth.model.stiffness)
    reopen(app, sessions_dir() / DEMO)
    assert shown(app, "fv-wrong") == "" and app.store.joint_name == "joint1"


def test_find_add_undo_remove(app: Application, diagnosed_demo: Diagnosis) -> None:
    assert off(app, "Undo") and off(app, "Redo") and off(app, "Stop")
    assert "Find the missing effect" in shown(app, "fv-next")
    app.store.go("Diagnose")
    use(app, "Find the missing effect")
    assert (
        app.store.running
        and off(app, "Find the missing effect")
        and not off(app, "Stop")
        and app.dock._bar.visible
    )
    wait(app)
    first = app.store.analysis
    assert first.identification is not None and first.diagnosis_up_to_date
    assert shown(app, "fv-verdict").find("Missing: Coulomb friction on joint2") > 0
    one_error_everywhere(app)
    best = diagnose_step(app).findings[0]
    assert best.add.visible and "coulomb 3.0" in shown(app, "fv-finding") and "Automatica" in shown(app)
    assert "Add and refit" in shown(app, "fv-next")

    calm = app.fall._shown.content
    use(app, "Add and refit")
    wait(app)
    fallen = app.fall._shown.content
    assert fallen != calm  # the pages see the error fall
    added = app.store.analysis
    assert added.effects == (EFFECT,) and added.up_to_date and added.diagnosis_up_to_date
    one_error_everywhere(app)
    assert "Nothing is missing" in shown(app, "fv-verdict") and not best.add.visible
    for stair, step in zip(added.model_steps, diagnosed_demo.steps, strict=True):
        assert np.allclose(stair.step.rms, step.rms, rtol=0.02)
        assert np.allclose(stair.step.rms_validation, step.rms_validation, rtol=0.02)  # type: ignore[arg-type]
    model_steps = app.plots._compare._charts["all"]._handle.data
    assert model_steps[1][0] > 20 * model_steps[1][-1]
    assert "Coulomb friction on joint2" in shown(app, "fv-stair")

    use(app, "Undo")
    assert not app.store.running  # nothing is computed again
    assert app.store.analysis is first and "Missing:" in shown(app, "fv-verdict")
    assert not off(app, "Redo") and "added Coulomb friction" in str(control(app, "Redo").hint)
    use(app, "Redo")
    assert app.store.analysis is added and off(app, "Redo")

    use(app, "Remove")
    wait(app)
    assert app.fall._shown.content == fallen  # once
    assert app.store.analysis.effects == () and "Missing:" in shown(app, "fv-verdict")
    assert len(app.store.analysis.model_steps) == 1


def test_add_all_is_a_history_of_steps(app: Application, diagnosed_demo: Diagnosis) -> None:
    reopen(app, sessions_dir() / DEMO)
    use(app, "Add all found")
    wait(app)
    assert app.store.analysis.effects == (EFFECT,)
    assert [step.label for step in app.store.session.past][-1] == "looked for the missing effect"
    assert "Nothing is missing" in shown(app, "fv-verdict")
    result, (_, last) = app.store.analysis.identification, app.store.analysis.model_steps
    assert result is not None and last.step.model is not None and app.store.analysis.up_to_date
    # the diagnosis's own values, not fitted again
    assert (
        np.allclose(result.model.stiffness, last.step.model.stiffness)
        and result.facts[0].kind == "values-given"
    )
    assert result.model.effects == last.step.model.effects
    assert last.step.rms_validation is not None
    assert last.step.rms == diagnosed_demo.steps[-1].rms  # on one core, to the last digit
    shares = 100 * np.divide(last.step.rms_validation, app.store.measurements.torque_spread)
    assert f"validation error {number(shares.mean(), 3)} % of the torque" in status(app)
    use(app, "Undo")
    assert app.store.analysis.effects == () and "Missing:" in shown(app, "fv-verdict")


@pytest.mark.slow
def test_effects_of_one_kind_are_added_and_removed_at_once(app: Application) -> None:
    reopen(app, sessions_dir() / DEMO)
    start = app.store.analysis.with_fit(refine=False)
    both = replace(DIAGNOSIS, findings=(COULOMB, replace(COULOMB, joint="joint1"), OFFSET))
    app.store.change("looked for the missing effect", start.with_diagnosis(both))
    states = len(app.store.session.past)
    assert "1. Coulomb friction on joints 1 and 2" in shown(app, "1. ")
    assert "2. Torque offset on joint1" in shown(app, "2. ")
    use(app, "Add and refit")
    wait(app)
    assert app.store.analysis.effects == (EFFECT, "coulomb_friction:joint1") and app.store.analysis.up_to_date
    assert len(app.store.session.past) == states + 1  # one step of the history
    assert app.store.session.undoes == "added Coulomb friction on joints 1 and 2"
    rows = shown(app, "fv-added").splitlines()
    assert len(rows) == 1 and "Coulomb friction on joints 1 and 2" in rows[0]
    assert "1. + Coulomb friction on joints 1 and 2" in shown(app, "fv-stair")
    assert "joint2: coulomb " in shown(app, "fv-stair")
    use(app, "Take apart")
    assert len(shown(app, "fv-added").splitlines()) == 2
    use(app, "Remove", index=1)
    wait(app)
    assert app.store.analysis.effects == (EFFECT,)
    use(app, "Undo")
    assert len(app.store.analysis.effects) == 2


def test_a_family_is_named_and_the_search_says_what_it_tried(app: Application) -> None:
    reopen(app, sessions_dir() / DEMO)
    start = app.store.analysis
    app.store.change("looked for the missing effect", start.with_diagnosis(TIED_DIAGNOSIS))
    assert "these data do not tell which kind" in shown(app, "fv-verdict")
    assert "1. Dry friction on joint2; these data" in shown(app, "1. ")
    assert "Dry friction on joint2 added" in shown(app, "Why these effects")
    added = app.store.analysis.with_effects([EFFECT])
    app.store.change(
        "added", added.with_diagnosis(replace(DIAGNOSIS, verdict="nothing-missing", findings=()))
    )
    assert not shown(app, "Why these effects")
    rows = shown(app, "fv-added").splitlines()
    assert len(rows) == 1 and "+ Dry friction on joint2" in rows[0]
    assert "1. + Dry friction on joint2" in shown(app, "fv-stair")
    use(app, "Undo")
    assert "Dry friction on joint2 added" in shown(app, "Why these effects")


def test_a_stopped_search_changes_nothing(app: Application) -> None:
    reopen(app, sessions_dir() / DEMO)
    use(app, "Find the missing effect")
    use(app, "Stop")
    wait(app)
    assert app.store.analysis.diagnosis is None and "stopped" in status(app)
    assert not off(app, "Find the missing effect") and off(app, "Undo")


def test_a_second_stop_ends_at_once_but_a_double_click_does_not(
    app: Application, monkeypatch: pytest.MonkeyPatch
) -> None:
    reopen(app, sessions_dir() / DEMO)
    use(app, "Find the missing effect")
    until(app, lambda: app.store.message.text != "looking")  # it has begun
    stop, graces = app.store.tasks.stop, list[float]()

    def noted(kind: Any, grace: float) -> None:
        graces.append(grace)
        stop(kind, grace)

    monkeypatch.setattr(app.store.tasks, "stop", noted)
    use(app, "Stop")
    assert "Stop again ends it at once" in status(app)
    use(app, "Stop")
    assert graces == [math.inf]
    monkeypatch.setattr("flexviz.outlets.app.state.DOUBLE_CLICK", 0.0)
    use(app, "Stop")
    assert graces == [math.inf, 0.0]
    wait(app)
    assert app.store.analysis.diagnosis is None and not off(app, "Find the missing effect")


def test_a_tie_offers_the_motion_that_decides(app: Application, monkeypatch: pytest.MonkeyPatch) -> None:
    reopen(app, sessions_dir() / DEMO)
    deciding = diagnose_step(app).deciding
    assert not deciding.button.visible
    app.store.change("looked", app.store.analysis.with_diagnosis(replace(DIAGNOSIS, findings=(COULOMB,))))
    assert deciding.button.visible and not deciding.download.visible
    use(app, DECIDE)
    until(app, lambda: "designing, " in status(app))
    use(app, "Stop")
    wait(app)
    assert "best motion so far" in status(app) and deciding.download.visible
    sent: list[tuple[str, bytes]] = []
    monkeypatch.setattr(app.page, "send_file", lambda client, name, content: sent.append((name, content)))
    use(app, DOWNLOAD)
    ((name, content),) = sent
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        assert name.endswith(".zip") and {"d1.csv", "d1.yaml"} < set(archive.namelist())
        assert "Coulomb friction on joint2 is the true one" in archive.read("summary.txt").decode()
    use(app, "Undo")
    assert not deciding.button.visible and not deciding.download.visible


@pytest.mark.slow
def test_a_change_meanwhile_wins(app: Application) -> None:
    reopen(app, sessions_dir() / DEMO)
    use(app, "Find the missing effect")
    (data,) = (step for step in app.dock.steps if isinstance(step, DataStep))
    send(app, data._roles["t1p1"], "Ignore")
    wait(app)
    assert app.store.analysis.diagnosis is None and "have changed in the meantime" in status(app)


@pytest.mark.slow
def test_free_curve_is_added_hatched_saved_and_taken_back(app: Application, tmp_path: Path) -> None:
    """Not physics, but with Coulomb friction left out it lowers the error; the history holds it."""
    reopen(app, sessions_dir() / DEMO)
    measurements, start = app.store.measurements, app.store.analysis
    result = identify(measurements)
    start = start.with_identification(result, start.settings)
    curve = FreeCurve(
        "joint2", "velocity", "rad/s", ("forward", "backward"), np.linspace(-1, 1, 5), np.ones((2, 5)),
        np.ones((2, 5)), 0.9, 0.01, 1.0,
    )  # fmt: skip
    known = prediction_errors(measurements, result.model)
    step = Step(
        None,
        known.rms,
        known.rms_validation,
        known.groups,
        known.noise_floor,
        result.model,
        verdict="unknown",
    )
    unknown = replace(
        DIAGNOSIS, set_name=measurements.name, verdict="unknown", findings=(), steps=(step,),
        free_curve=curve, model=result.model, notes=(),
    )  # fmt: skip
    app.store.change("looked for the missing effect", start.with_diagnosis(unknown))
    before = app.store.analysis
    assert control(app, "Add the free curve").visible
    use(app, "Add the free curve")
    wait(app)
    added = app.store.analysis
    (text,) = added.effects
    assert text in ("free_curve_velocity:joint2", "free_link_curve_velocity:joint2")
    assert added.up_to_date and added.diagnosis_up_to_date and not control(app, "Add the free curve").visible
    one_error_everywhere(app)
    first, last = (one.step.rms_validation for one in added.model_steps)
    assert first and last and last[1] < 0.2 * first[1]
    assert "(not physics) on joint2" in app.store.session.undoes
    assert shown(app, "fv-stair").count("fv-stair hatched") == 1 and "(not physics)" in shown(app, "fv-stair")
    charts = staircase_charts(added.model_steps, 1, measurements.joints, measurements.torque_spread)
    assert all(chart.series[0].label == "hatched: not physics" for chart in charts)
    hatch = charts[0].series[0]
    inside = hatch.x > 0.5
    assert np.ptp(np.log(hatch.y[inside])) > 0 and len(np.unique(hatch.y[hatch.x < 0.5])) == 1

    assert "forward 1" not in shown(app)  # the nodes are charts, not rows
    (curve_chart,) = model_curve_charts(added.identification.parameters)  # type: ignore[union-attr]
    assert curve_chart.title.startswith("In the model: Free curve of velocity")
    page = re.sub("</?abbr[^>]*>", "", session_report(app.store.session, measurements))
    assert "Added: Free curve of velocity" in page and "Not physics: it lowers" in page
    assert "A free curve on joint2, which is not physics, stands for what is unknown." in page
    assert "In the model: Free curve of velocity" in page

    folder = save_session(app.store.session, measurements, tmp_path / "saved")
    again = open_session(folder).session.analysis
    assert again.effects == added.effects and again.identification is not None
    assert again.identification.model.effects == added.identification.model.effects  # type: ignore[union-attr]
    use(app, "Undo")
    assert app.store.analysis is before and control(app, "Add the free curve").visible
