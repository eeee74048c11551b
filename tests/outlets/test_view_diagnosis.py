"""A diagnosis in words, cards, model_steps and maps."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flexviz.analysis.diagnosis import DIRECTED, Diagnosis, Evidence, Finding, PredictionErrors, Step
from flexviz.analysis.diagnosis.residuals import UNITS
from flexviz.content.blocks import Paragraph, TableBlock
from flexviz.content.records import (
    Absorbed,
    EffectParameter,
    FreeCurve,
    GroupError,
    Note,
    ParameterEstimate,
    ResidualLocation,
    ResidualMap,
    Tie,
)
from flexviz.content.rendering import panel
from flexviz.content.results import evidence_chart
from flexviz.content.session import Analysis, ModelStep
from flexviz.content.topics import finding_panel, heading, map_panel, verdict_panel, why_blocks
from flexviz.content.view.effects import card_html, picture
from flexviz.content.view.free_curves import free_chart, free_html
from flexviz.content.view.residual_time import BeforeAfter, time_residual
from flexviz.content.view.residuals import (
    MAP_COLUMNS,
    ResidualSamples,
    map_charts,
    map_of,
    range_html,
    stretches_of,
)
from flexviz.content.view.staircase import NO_STEPS, StaircaseRun, staircase_charts, staircase_html
from flexviz.content.view.status import next_step, steps_done
from flexviz.content.wording import MergedFinding, effect_text_name, share_text, values_text, verdict_text
from flexviz.model.effects import EFFECTS
from flexviz.outlets.app.uplot import columns
from tests.found import TIED, TIED_DIAGNOSIS

JOINTS = ("joint1", "joint2")
TIE = Tie("link_coulomb_friction", "joint2", 0.97, "A payload twice as heavy would tell the two apart.")
ABSORBED = Absorbed("motor_viscous_friction", "joint2", 12.0, 10.1, "Nm s/rad", 30.0)
FINDING = Finding(
    effect="coulomb_friction", joint="joint2", score=0.62, confidence=0.98,
    parameters={"coulomb": EffectParameter(3.0, 0.01, "Nm")},
    inseparable_from=(TIE,), gain=400.0, absorbed=(ABSORBED,),
    evidence=Evidence(
        "joint2", (("g1", 0, 50), ("g2", 50, 100)), np.tile(np.linspace(0, 5, 50), 2),
        np.ones(100), np.zeros(100),
    ),
)  # fmt: skip
STEP = Step(
    None,
    (2.0, 1.0),
    (2.2, 1.1),
    (GroupError("g1", (2.0, 1.0), False), GroupError("g4", (2.2, 1.1), True)),
    (0.01, 0.02),
    verdict="missing",
)
LOW = replace(STEP, rms=(0.2, 0.1), groups=tuple(replace(one, rms=(0.2, 0.1)) for one in STEP.groups))
DIAGNOSIS = Diagnosis(
    set_name="set",
    verdict="missing",
    findings=(FINDING,),
    where=(ResidualLocation("joint2", "velocity", 0.31, (-1.0, 1.0)),),
    steps=(STEP,),
    effects=(),
    parameters=(),
    seconds=3.0,
)


def test_the_verdict_begins_as_agreed() -> None:
    assert verdict_text(DIAGNOSIS).startswith("Missing: Coulomb friction on joint2.")
    assert verdict_text(replace(DIAGNOSIS, findings=())).startswith("Missing:")
    assert verdict_text(replace(DIAGNOSIS, verdict="nothing-missing")).startswith("Nothing is missing:")
    unknown = verdict_text(replace(DIAGNOSIS, verdict="unknown"))
    assert unknown.startswith("Unknown:") and "joint2, where 31 % of it follows the velocity" in unknown
    assert verdict_text(replace(DIAGNOSIS, verdict="unknown", where=())).startswith("Unknown:")
    # the joint that errs most is not always the one with the structured residual, for which there is a curve
    both = (*DIAGNOSIS.where, ResidualLocation("joint1", "time", 0.07, (0.0, 1.0)))
    split = verdict_text(replace(DIAGNOSIS, verdict="unknown", where=both), worst="joint1")
    assert split.endswith("mostly on joint1; of the residual of joint2, 31 % follows the velocity.")


def verdict_of(diagnosis: Diagnosis | None, up_to_date: bool = True) -> str:
    return panel(verdict_panel(diagnosis, up_to_date, JOINTS))


def test_the_verdict_says_when_it_is_old_or_cut_short() -> None:
    assert "tries every known effect" in verdict_of(None)
    old = verdict_of(replace(DIAGNOSIS, stopped=True), up_to_date=False)
    assert "<s>Missing: Coulomb friction on joint2." in old and "look again" in old
    assert "Stopped before the end" not in old  # nothing else is said of another model
    assert "Stopped before the end" in verdict_of(replace(DIAGNOSIS, stopped=True))
    low = tuple(ParameterEstimate("motor_inertia", joint, 1e-3, 1.0, "kg m²", "no", 1.0) for joint in JOINTS)
    assert "joint torque sensor" in verdict_of(replace(DIAGNOSIS, parameters=low))
    assert "&lt;b&gt;" in verdict_of(replace(DIAGNOSIS, notes=(Note("other", "<b>"),)))
    notes = (
        Note("unexplained", "what stays is small"),
        Note("free-curve", "a free curve against the position would take 3 %"),
    )
    told = replace(DIAGNOSIS, verdict="unknown", notes=notes)
    assert "A free curve" in verdict_of(told) and "What stays is small." in verdict_of(told)
    assert "A free curve" not in verdict_of(replace(told, free_curve=free_curve([[1.0, 2.0]])))
    assert heading(told) and heading(DIAGNOSIS) == heading(None) == heading(replace(told, findings=())) == []


@pytest.mark.parametrize("share, text", [(0.0, "< 1 %"), (0.5, "50 %"), (0.999, "> 99 %"), (1.0, "> 99 %")])
def test_nothing_is_said_to_be_certain(share: float, text: str) -> None:
    assert share_text(share) == text


def test_a_finding_gives_values_interval_ties_and_hiding_places() -> None:
    assert values_text(FINDING) == "coulomb 3.000 ± 0.020 Nm"
    tilt = {"tilt_x": EffectParameter(-1e-9, 30.0, "rad"), "tilt_y": EffectParameter(0.02, 1e-4, "rad")}
    turned = replace(FINDING, effect="base_tilt", joint=None, parameters=tilt)
    assert values_text(turned) == "tilt x not determined, tilt y 20.00 ± 0.20 mrad"  # bounds: ± 0.6
    text = panel(finding_panel(MergedFinding((FINDING,)), 1, full=True))
    for part in ("1. Coulomb friction on joint2", "98 %", "62 %", "twice as heavy", "12.00 → 10.10 Nm s/rad"):
        assert part in text, part
    bare = replace(FINDING, inseparable_from=(), absorbed=(), parameters={}, evidence=None)
    assert "fv-warn" not in panel(finding_panel(MergedFinding((bare,)), 2, full=True))


def test_a_card_names_the_family_and_its_kinds() -> None:
    text = panel(finding_panel(MergedFinding((TIED,), 0.98), 1, full=True))
    assert "1. Dry friction on joint2; these data do not tell which kind" in text
    assert "confidence 97 %, removes 98 % of the error" in text and "fv-likely" in text
    assert "The model uses the simplest, Coulomb friction." in text
    assert "Alike" not in panel(finding_panel(MergedFinding((FINDING,)), 1, full=True))


@pytest.mark.parametrize(
    "text, name",
    [
        ("coulomb_friction:joint2", "Coulomb friction on joint2"),
        ("external_contact:joint1@g2", "on joint1 in group g2"),
        ("torque_delay", EFFECTS["torque_delay"].title),
    ],
)
def test_an_effects_text_in_words(text: str, name: str) -> None:
    assert name in effect_text_name(text)


@pytest.mark.parametrize("name", list(EFFECTS))
def test_every_effect_has_a_card_with_equation_and_picture(name: str) -> None:
    card = card_html(name)
    assert EFFECTS[name].title.split()[0].lower() in card.lower() and "fv-equation" in card
    assert picture(name).startswith("<svg")
    assert picture(name) in card


def test_an_unknown_effect_has_none() -> None:
    assert card_html("no_such") == "" and picture("../../etc/passwd") == ""


def test_evidence_follows_the_group() -> None:
    chart = evidence_chart(FINDING, "g2")
    assert "g2" in chart.title and len(chart.series) == 2 and len(chart.series[0].x) == 50
    assert "1.00 Nm rms" in chart.description and not chart.playhead
    assert "g1" in evidence_chart(FINDING, "g9").title
    assert evidence_chart(replace(FINDING, evidence=None), "g1").note
    assert not evidence_chart(None, "g1").series


def test_stairs_fall_and_say_what_was_added() -> None:
    model_steps = (ModelStep((), STEP), ModelStep(("coulomb_friction:joint2",), LOW))
    both, one = staircase_charts(model_steps, 1, JOINTS, (4.0, 4.0))
    labels = [series.label for series in both.series]
    assert labels == ["g1", "g4 (validation)", "noise"]
    assert both.series[0].y[0] == pytest.approx(37.5) and both.series[0].y[-1] == pytest.approx(3.75)
    assert list(columns(both)[0]) == [-0.5, 0.5, 0.5, 1.5] and one.series[0].y[0] == pytest.approx(25.0)
    assert both.x.ticks == ((0, "0"), (1, "1")) and both.series[1].dash and not both.series[0].dash
    assert both.series[-1].y == pytest.approx([0.375, 0.375])  # the noise: one for all models
    assert "g1 from 37.5 to 3.75 % of the torque" in both.description
    assert "+ Coulomb friction on joint2" in staircase_html(model_steps, JOINTS)
    families = (("coulomb_friction:joint2", "dry_friction"),)
    untold = (model_steps[0], replace(model_steps[1], families=families))
    assert "+ Dry friction on joint2" in staircase_html(untold, JOINTS)
    without = tuple(ModelStep(s.effects, replace(s.step, groups=(), noise_floor=())) for s in model_steps)
    assert [series.label for series in staircase_charts(without, 0, JOINTS)[0].series] == [
        "fit",
        "validation",
    ]
    assert staircase_charts((), 0, JOINTS)[0].note == NO_STEPS and staircase_html((), JOINTS) == ""
    last = model_steps[-1].step
    worse = tuple(2 * value for value in last.rms_validation or last.rms)
    run = PredictionErrors(last.rms, worse, (), last.noise_floor, np.zeros((0, 2)))
    better = PredictionErrors((0.1, 0.1), (0.1, 0.1), (), last.noise_floor, np.zeros((0, 2)))
    runs = [
        StaircaseRun("Run: eso, 80 rad/s", run, 1, True),
        StaircaseRun("Run: first", better, -1, False),
        StaircaseRun("Run: between", better, 0, False),
    ]
    table = staircase_html(model_steps, JOINTS, runs=runs)
    order = [
        "Run: first",
        "0. no effect added ▲",
        "Run: between",
        "1. + Coulomb",
        "Run: eso, 80 rad/s",
    ]
    text = re.sub(r"<[^>]*>", "", table)
    places = [text.index(one) for one in order]
    assert places == sorted(places) and text.count("● shown") == 1
    assert text.count("▲ rises") == 3 and "Run: eso, 80 rad/s ● shown ▲ rises" in text
    assert "Run: eso" in staircase_html((), JOINTS, runs=runs[:1])  # nothing is diagnosed yet


def residuals(n: int = 2000) -> Any:
    time = np.linspace(0.0, 10.0, n)
    q = np.stack([np.sin(time), np.cos(time)], axis=1)
    velocity = np.stack([np.cos(time), -np.sin(time)], axis=1)
    series = SimpleNamespace(time=time, q=q, torque=q, residual=2.0 * np.sign(velocity))
    return SimpleNamespace(residuals={"g1": series, "g2": series}, noise_in=lambda group: (0.1, float("nan")))


def test_the_residual_over_time_lies_in_the_band_of_the_noise() -> None:
    fits = BeforeAfter(residuals())
    chart = time_residual(fits, 0, "joint1", "g1")
    (ribbon,) = chart.ribbons
    assert ribbon.high == pytest.approx(0.196) and ribbon.low == pytest.approx(-0.196)
    assert np.abs(chart.series[0].y).max() == 2.0 and chart.x.limits == (0.0, 10.0) and chart.playhead
    assert (
        ResidualSamples.of(None, 0) is None
        and "Run" in time_residual(BeforeAfter(None), 0, "joint1", "g1").note
    )
    assert "g9 has no residual" in time_residual(fits, 0, "joint1", "g9").note


def test_a_range_marks_its_instants() -> None:
    found = ResidualSamples.of(residuals(), 0)
    assert found is not None
    low, high = found.limits("position") or (0.0, 0.0)
    assert (low, high) == pytest.approx((-1.0, 1.0), abs=0.11) and found.limits("nothing") is None
    time, inside = found.instants("position", 0.5, 1.0, "g2")
    assert np.mean(inside) == pytest.approx(np.mean(np.sin(np.linspace(0, 10, 2000)) >= 0.5), abs=0.01)
    marked = stretches_of(time, inside)
    assert len(marked) == 2 and sum(b - a for a, b in marked) == pytest.approx(10 * np.mean(inside), abs=0.02)
    chart = replace(time_residual(BeforeAfter(residuals()), 0, "joint1", "g2"), highlights=marked)
    assert set(columns(chart)[-1]) == {0.0, 1.0} and stretches_of(time, inside & False) == ()
    nowhere = found.instants("position", 0.5, 1.0, "g9")
    assert not len(nowhere[0]) and range_html("position", 0.5, 1.0, nowhere[1]) == ""


def residual_map(joint: str, variable: str, explained: float, curves: tuple[str, ...] = ("",)) -> ResidualMap:
    shape = (len(curves), 6)
    mean = np.full(shape, 0.3)
    mean[0, 0] = np.nan  # an empty bin
    return ResidualMap(
        joint, variable, UNITS[variable], curves, np.tile(np.linspace(-1, 1, 6), (shape[0], 1)), mean,
        np.full(shape, 0.1), np.full(shape, 50), explained, 0.01, {}, (-0.5, 0.5),
    )  # fmt: skip


def test_the_maps_are_the_diagnosis_own() -> None:
    assert set(MAP_COLUMNS) == set(UNITS)
    maps = [residual_map("joint2", name, 0.1) for name in UNITS if name != DIRECTED]
    maps.append(residual_map("joint2", DIRECTED, 0.4, ("forward", "backward")))
    text = panel(map_panel(maps, ("joint1", "joint2"), 1))
    assert text.count("<td style") == len(MAP_COLUMNS) and text.count("<td>–</td>") == len(MAP_COLUMNS)
    assert "<b>joint2</b>" in text and "40.0 ± 2.0 %" in text and map_panel((), ("joint1",)) == []
    assert text.count("/ 0.10)") == len(MAP_COLUMNS) - 1 and "/ 0.40)" in text  # faint where little lies
    assert map_of(maps, "joint1", "load") is None
    charts = {chart.key: chart for chart in map_charts(maps, "joint2")}
    assert [series.label for series in charts["position"].series] == ["forward", "backward"]  # they differ
    velocity = charts["velocity"]
    assert len(columns(velocity)[0]) == 5 and len(velocity.ribbons) == 1  # without the empty bin
    assert velocity.ribbons[0].high == pytest.approx(0.196) and "10 %" in velocity.title
    assert velocity.highlights == ((-0.5, 0.5),) and "most of it from −0.500 to 0.500" in velocity.description
    assert all(np.isfinite(column).all() for chart in charts.values() for column in columns(chart))
    maps[-1] = residual_map("joint2", DIRECTED, 0.12, ("forward", "backward"))
    assert len(map_charts(maps, "joint2")[0].series) == 1  # the direction says nothing more
    assert not any(chart.series for chart in map_charts((), "joint2"))


def free_curve(value: list[list[float]], variable: str = "position") -> FreeCurve:
    values = np.array(value)
    names = ("forward", "backward") if len(values) == 2 else ("",)
    centres = np.linspace(-1.0, 1.0, values.shape[1])
    return FreeCurve(
        "joint2", variable, "rad", names, centres, values, 0.1 * np.ones_like(values), 0.43, 0.02, 1.0
    )


def test_the_free_curve_says_that_it_is_not_physics() -> None:
    nan = float("nan")
    both = free_chart(free_curve([[nan, 1.0, 2.0, 3.0], [-1.0, -2.0, -3.0, nan]]))
    assert [series.label for series in both.series] == ["forward", "backward"]
    assert len(columns(both)[0]) == 2 and len(both.ribbons) == 2 and both.title.endswith("(not physics)")
    assert both.ribbons[0].high[1:] == pytest.approx(both.series[0].y[1:] + 0.196)
    apart = free_chart(free_curve([[nan, nan, 2.0, 3.0], [-2.0, -1.0, nan, nan]], "velocity"))
    assert list(apart.series[0].y) == [-2.0, -1.0, 2.0, 3.0] and len(apart.ribbons) == 1
    assert len(columns(free_chart(free_curve([[1.0, 2.0, 3.0]])))[0]) == 3
    text = free_html(free_curve([[1.0, 2.0]]))
    assert "43 ± 4 %" in text and "not physics" in text
    assert not free_chart(None).series and free_html(None) == ""
    doubtful = replace(free_curve([[1.0, 2.0]]), explained=0.03, explained_std=0.02)  # perhaps nothing
    assert not free_chart(doubtful).series and free_html(doubtful) == ""


def test_what_to_do_next(tmp_path: Any) -> None:
    analysis = Analysis(tmp_path, roles=(("g1", "fit"),))
    assert next_step(analysis, "Data", False).step == "Diagnose"
    assert "<b>Stop</b>" in next_step(analysis, "Data", True).text
    assert next_step(analysis.with_role("g1", "ignore"), "Diagnose", False).step == "Data"
    looked = analysis.with_diagnosis(DIAGNOSIS)
    other = looked.with_fit(bandwidth=80.0)
    assert next_step(other, "Data", False).button == "find" and "Done" not in next_step(other, "", False).text
    assert "the verdict is of an earlier model" in next_step(other, "Data", False).text
    assert steps_done(other) == ()
    assert next_step(looked, "Diagnose", False).button == "add" and steps_done(looked) == ("Diagnose",)
    done = looked.with_effects(["a"]).with_diagnosis(
        replace(DIAGNOSIS, verdict="nothing-missing", findings=())
    )
    assert "Compare" in next_step(done, "Diagnose", False).text


def test_what_was_tried_is_a_table() -> None:
    moves, decoys = why_blocks(TIED_DIAGNOSIS, JOINTS)
    assert isinstance(moves, TableBlock) and isinstance(decoys, Paragraph)
    assert [[cell.text for cell in row] for row in moves.rows][:2] == [
        ["Dry friction on joint2 added", "400 ± 12", "coarse", "accepted"],
        ["Torque offset on joint1 not added", "1.5 ± 1.0", "fine", "within its error"],
    ]
    assert decoys.text.startswith("Of 40 decoys none was accepted")
    harmful = replace(TIED_DIAGNOSIS.trace[1], why="<b>")
    assert "<b><b>" not in panel(why_blocks(replace(TIED_DIAGNOSIS, trace=(harmful,), decoys=None), JOINTS))
    assert list(why_blocks(DIAGNOSIS, JOINTS)) == []
