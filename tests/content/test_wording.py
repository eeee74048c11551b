"""Errors in words, and effects of one kind as one finding."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from pydantic import ValidationError

from flexviz.analysis.diagnosis import Step
from flexviz.analysis.laws import VARIABLES
from flexviz.content.records import (
    PERCENT,
    Absorbed,
    Decoys,
    DetectionLimit,
    EffectParameter,
    JointErrors,
    LimitReason,
    Move,
    Note,
    mean_nrms,
    stated_errors,
    step_shares,
)
from flexviz.content.results import ResultDocument
from flexviz.content.wording import (
    FAMILY_TITLES,
    decoys_text,
    error_hover,
    error_short,
    error_text,
    error_whole,
    explained,
    family_title,
    joints_text,
    kinds_text,
    left_text,
    merged_findings,
    merged_texts,
    moved,
    span_text,
    text_names,
    text_runs,
    told_moves,
    verdict_text,
)
from flexviz.content.wording.law_axes import VARIABLES as LABELS
from flexviz.content.wording.verdicts import STOPPED
from flexviz.model.effects import EFFECT_FAMILIES
from tests.found import AFTER, BEFORE, COULOMB, DIAGNOSIS, FRICTION, OFFSET, TIED, TIED_DIAGNOSIS, TRACE

FIRST = replace(COULOMB, joint="joint1", parameters={"coulomb": EffectParameter(7.0, 0.02, "Nm")}, score=0.5)
JOINTS = ("joint1", "joint2")


def test_an_error_is_in_per_cent_of_the_torque_and_in_nm_beside_the_noise() -> None:
    errors = JointErrors((0.3, 0.4), (3.0, 1.0), (0.1, 0.01))
    assert errors.unit == PERCENT and errors.values == pytest.approx([10.0, 40.0]) and errors.order == [1, 0]
    assert error_whole(errors) == "25.0 % of the torque (0.354 Nm)"
    assert error_whole(errors, 0) == "10.0 % of the torque (0.300 Nm)"
    assert (error_short(errors), error_short(errors, 1)) == ("25.0 %", "40.0 %")
    assert errors.mark is not None and errors.mark.values == pytest.approx([10 / 3, 1.0])
    assert error_hover(errors, 1) == "0.400 Nm; noise: 1.00 %, 10.0 mNm"
    # the torque of a joint that is held still has no spread; a noise of zero is none
    assert error_hover(JointErrors((0.3,), (0.0,), (0.0,)), 0) == "0.300 Nm"
    assert JointErrors((0.3, 0.4)).mark is None
    step: Any = SimpleNamespace(rms=(0.3,), rms_validation=(0.2,), noise_floor=(0.1,), units=())
    assert error_text(stated_errors(step, (2.0,))) == "10.0 % of the torque"
    step.rms_validation = (math.nan,)
    assert error_text(stated_errors(step, (2.0,))) == "15.0 % of the torque"


def test_the_variables_of_laws_have_labels() -> None:
    assert set(VARIABLES) == set(LABELS)


def test_the_noise_of_a_model_changes_no_error() -> None:
    """A model that passes more noise, with a smaller error in Nm, is not told as worse."""
    before: Any = SimpleNamespace(rms=(2.0,), rms_validation=None, noise_floor=(0.1,), units=())
    after: Any = SimpleNamespace(rms=(1.0,), rms_validation=None, noise_floor=(0.01,), units=())
    assert stated_errors(after, (9.0,)).mean < stated_errors(before, (9.0,)).mean
    assert stated_errors(after, ()).mean < stated_errors(before, ()).mean


def test_an_error_is_told_in_other_units_where_the_torque_is_unknown() -> None:
    assert (
        error_whole(JointErrors((0.3, 0.4))) == "0.354 Nm"
        and error_text(JointErrors((0.03,)), 0) == "30.0 mNm"
    )
    assert mean_nrms((0.3, 0.4), (0.0, 1.0)) == 0.4  # a constant torque has no share
    assert [explained(e) for e in (0.2, 0.078, 1e-4, 1.7, math.nan)] == [
        "96 %", "99.4 %", "> 99.999 %", "0 %", "–",
    ]  # fmt: skip


def test_what_stays_is_ranked_by_the_measure() -> None:
    text = left_text(("arm", "wrist"), JointErrors((90.0, 15.0), (600.0, 200.0), (15.0, 0.15)))
    assert text == "arm 15.0 % of its torque (90.0 Nm); wrist 7.50 % of its torque (15.0 Nm)"
    assert left_text(("a", "b"), JointErrors((1.0, 2.0))) == "b 2.00 Nm; a 1.00 Nm"


@pytest.mark.parametrize(
    "names, joints, text",
    [
        (("joint_3", "joint_1", "joint_12"), (), "joints 1, 3 and 12"),
        (("panda_joint2", "panda_joint1"), (), "joints 1 and 2"),
        (("joint1", "joint2"), JOINTS, "joints 1 and 2"),
        (("wrist", "elbow"), ("elbow", "wrist", "hand"), "elbow and wrist"),
        (("a", "b", "c"), ("a", "b", "c"), "all three joints"),
        (("joint2",), (), "joint2"),
    ],
)
def test_joints_in_a_sentence(names: tuple[str, ...], joints: tuple[str, ...], text: str) -> None:
    assert joints_text(names, joints) == text


def test_likely_effects_of_one_kind_are_merged() -> None:
    doubtful = replace(COULOMB, joint="joint3", confidence=0.3)
    found = merged_findings((COULOMB, OFFSET, FIRST, doubtful))
    assert [merged.name() for merged in found] == [
        "Coulomb friction on joints 1 and 2", "Torque offset on joint1", "Coulomb friction on joint3",
    ]  # fmt: skip
    assert [m.joint for m in found[0].by_joint(JOINTS)] == ["joint1", "joint2"]
    # rivals of one search stay apart: at most one of them is likelier than not
    assert len(merged_findings((COULOMB, replace(FIRST, confidence=0.01)))) == 2
    group = replace(COULOMB, effect="external_contact", group="g1")
    assert len(merged_findings((group, replace(group, joint="joint1")))) == 2


def test_merged_by_their_texts() -> None:
    texts = ("a:joint2", "torque_delay", "a:joint1", "payload_error:p1", "payload_error:p2")
    assert merged_texts(texts, JOINTS) == [
        ("a:joint2", "a:joint1"), ("torque_delay",), ("payload_error:p1",), ("payload_error:p2",),
    ]  # fmt: skip
    assert text_names(("coulomb_friction:joint2", "coulomb_friction:joint1"), JOINTS) == [
        "Coulomb friction on joints 1 and 2"
    ]
    added = ([], ["a:joint2"], ["a:joint1"], ["b:joint1"], ["a:joint1@g1"], ["a:joint1@g2"])
    assert [(texts, last) for _, texts, last in text_runs(added, JOINTS)] == [
        ([], 0), (["a:joint2", "a:joint1"], 2), (["b:joint1"], 3), (["a:joint1@g1"], 4), (["a:joint1@g2"], 5),
    ]  # fmt: skip


def test_what_was_absorbed_is_listed_once() -> None:
    def absorbing(*entries: Absorbed) -> Any:
        return SimpleNamespace(absorbed=entries)

    first = absorbing(Absorbed("stiffness", "joint1", 9.0, 5.0, "Nm/rad", 3.0))
    second = absorbing(
        Absorbed("stiffness", "joint1", 5.0, 2.0, "Nm/rad", 7.0),
        Absorbed("mass", "joint2", 1.0, 2.0, "kg", 5.0),
    )
    stiffness, mass = moved((first, second))
    assert (stiffness.before, stiffness.after, stiffness.deviations) == (
        9.0,
        2.0,
        7.0,
    ) and mass.name == "mass"


def lines(diagnosis: Any, spread: tuple[float, ...] = ()) -> str:
    return replace(diagnosis, torque_spread=spread).summary(width=160)


def test_the_summary_has_one_line_per_kind_with_the_share_of_the_torque() -> None:
    both: Step = replace(AFTER, added=FIRST, rms_validation=(0.02, 0.3))
    diagnosis = replace(DIAGNOSIS, findings=(COULOMB, FIRST, OFFSET), steps=(BEFORE, AFTER, both))
    text = lines(diagnosis, (11.0, 10.0))
    assert text.startswith("Missing: Coulomb friction on joints 1 and 2: 98 % of the error, confidence 98 %.")
    assert (
        "1. Coulomb friction on joints 1 and 2 (coulomb_friction): together they remove 98 % of the error"
        in text
    )
    assert "joint1: coulomb 7.000 ± 0.039 Nm" in text and "joint2: coulomb 3.000 ± 0.020 Nm" in text
    rows = [line.split() for line in text.splitlines()]
    assert ["joint2", "11.0", "3.00"] in [row[:3] for row in rows] and ["mean", "15.5", "1.59"] in [
        row[:3] for row in rows
    ]
    assert "model 1: + Coulomb friction on joints 1 and 2 → unknown" in text and "model 2" not in text
    assert "What is left: joint2 3.00 % of its torque (0.300 Nm); joint1 0.182 % of its torque" in text
    assert text.count("absorbed") == 1 and "unexplained" not in text
    assert "Rms residual of each joint [% of the torque], held-out groups" in text
    assert "0.200 % (20.0 mNm)" in text  # the noise
    silent = tuple(replace(step, noise_floor=()) for step in diagnosis.steps)
    assert "0.200 % (20.0 mNm)" not in lines(replace(diagnosis, steps=silent), (11.0, 10.0))
    assert "each joint [Nm], held-out" in lines(replace(diagnosis, steps=silent))  # nor the torque


def test_a_held_out_group_without_samples_leaves_no_empty_error() -> None:
    steps = (replace(BEFORE, rms_validation=()), replace(AFTER, rms_validation=()))
    text = lines(replace(DIAGNOSIS, steps=steps), (11.0, 10.0))
    assert "fitted groups" in text and "Nm Nm" not in text


def test_rivals_stay_apart_in_the_verdict() -> None:
    assert verdict_text(DIAGNOSIS).startswith("Missing: Coulomb friction on joint2: > 99 % of the error")
    untried = replace(DIAGNOSIS, steps=(BEFORE,))  # without --apply
    assert verdict_text(untried).startswith("Missing: Coulomb friction on joint2. It explains 62 %")
    entries = [COULOMB, FIRST]
    assert merged_findings(entries)[0].name(JOINTS) == "Coulomb friction on joints 1 and 2"


def test_what_is_left_at_reversals_is_said_with_the_verdict() -> None:
    clean = replace(DIAGNOSIS, verdict="nothing-missing")
    noise = "Nothing is missing: the residual looks like noise"
    assert verdict_text(clean).startswith(f"{noise}, and no effect")
    pulses = replace(clean, notes=(*clean.notes, Note("pulses", "the error arises at motion reversals")))
    assert verdict_text(pulses).startswith(f"{noise}, but for reversals and backlash crossings, and no")


def test_where_a_residual_is_largest() -> None:
    def place(variable: str, low: float | None, high: float | None) -> Any:
        return SimpleNamespace(joint="joint1", variable=variable, explained=0.5, range=(low, high))

    groups = ("run1", "run2")
    assert span_text(place("velocity", -0.25, 1.5), "rad/s", groups) == "−0.250 … 1.50 rad/s"
    assert span_text(place("velocity", None, 1.5), "rad/s", groups) == "– … 1.50 rad/s"
    assert span_text(place("group", 1.0, 1.0), "-", groups) == "run2"


def test_shares_of_the_error_add_up_to_what_was_removed() -> None:
    def step(*rms: float, held_out: tuple[float, ...] | None = None) -> Step:
        return replace(BEFORE, rms=rms, rms_validation=held_out)

    # joints with another torque: only the share of the torque counts
    spread = (10.0, 100.0)
    steps = [step(4.0, 40.0), step(0.0, 40.0), step(0.0, 20.0)]
    assert step_shares(steps, spread) == pytest.approx([0.0, 0.5, 0.375])
    assert sum(step_shares(steps, ())) == pytest.approx(1 - 400 / 1616)  # without it, Nm
    # what raises the error removes nothing, and nothing is counted twice
    steps = [step(4.0), step(1.0), step(2.0), step(1.0)]
    assert step_shares(steps, (10.0,)) == pytest.approx([0.0, 15 / 18 * 15 / 16, 0.0, 3 / 18 * 15 / 16])
    assert step_shares([step(1.0), step(2.0)], (1.0,)) == [0.0, 0.0]
    # of the held-out groups, where all models have them
    held = [step(4.0, held_out=(2.0,)), step(0.0, held_out=(1.0,))]
    assert step_shares(held, (10.0,)) == pytest.approx([0.0, 0.75])
    assert step_shares([held[0], step(0.0)], (10.0,)) == pytest.approx([0.0, 1.0])
    assert step_shares([], ()) == [] and step_shares(steps[:1], (10.0,)) == [0.0]


def one_of_six(joint: str, effect: str = "coulomb_friction", **changes: Any) -> Any:
    return replace(COULOMB, effect=effect, joint=joint, parameters={}, **changes)


def test_the_headline_names_what_removes_most_of_the_error() -> None:
    """A cable spring that was found first and explains next to nothing does not lead."""
    joints = tuple(f"joint{k}" for k in range(1, 7))
    added = [one_of_six("joint2", "cable_spring", confidence=0.99), *map(one_of_six, joints)]
    rms = [7.0, 6.99, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0]
    steps = [replace(BEFORE, added=None if k == 0 else added[k - 1], rms=(r,), rms_validation=(r,),
                     groups=(), noise_floor=()) for k, r in enumerate(rms)]  # fmt: skip
    found = replace(DIAGNOSIS, findings=tuple(added), steps=tuple(steps), model=None)
    said = "Missing: Coulomb friction on all six joints: 98 % of the error, confidence 98 %."
    assert verdict_text(found, joints=joints) == said
    assert verdict_text(found.document(), joints=joints) == said  # and from a file
    text = found.summary().splitlines()
    assert text[0].startswith("Missing: Coulomb friction on joints 1, 2, 3, 4, 5 and 6: 98 %")
    order = [line for line in text if line.strip()[:2] in ("1.", "2.")]
    assert (
        "together they remove 98 % of the error" in order[0]
        and "Cable spring on joint2 (cable_spring)" in order[1]
    )
    assert "removes < 1 % of the error, confidence 99 %" in order[1]
    shares = [candidate["share"] for candidate in found.to_dict()["candidates"]]
    assert shares == sorted(shares, reverse=True) and sum(shares) == pytest.approx(1 - 1 / 49)


def test_a_family_is_named_where_the_data_do_not_tell_its_members_apart() -> None:
    untold = "these data do not tell which kind"
    assert verdict_text(TIED_DIAGNOSIS) == (
        f"Missing: Dry friction on joint2: > 99 % of the error, confidence 97 %; {untold}."
    )
    assert verdict_text(replace(TIED_DIAGNOSIS, steps=(BEFORE,))).endswith(f"confidence 97 %; {untold}.")
    text = TIED_DIAGNOSIS.summary()
    assert f"1. Dry friction on joint2; {untold} (coulomb_friction): coulomb 3.000" in text
    assert "confidence 97 %" in text and "+ Dry friction on joint2" in text
    # told apart: the effect, as ever
    told = replace(TIED, family=replace(FRICTION, tied=False), confidence=0.98)
    assert verdict_text(replace(DIAGNOSIS, findings=(told,), steps=(BEFORE,))).startswith("Missing: Coulomb")
    # one family on several joints is one finding, beside an effect of it that was told apart
    both = (TIED, replace(TIED, joint="joint1"), replace(told, joint="joint1"))
    names = [merged.statement(JOINTS) for merged in merged_findings(both)]
    assert names == [f"Dry friction on joints 1 and 2; {untold}", "Coulomb friction on joint1"]
    assert kinds_text(TIED) == (
        "Alike in these data: Coulomb friction and Coulomb friction at the link. "
        "The model uses the simplest, Coulomb friction."
    )
    assert kinds_text(COULOMB) == ""


def test_every_family_has_a_title() -> None:
    assert FAMILY_TITLES.keys() == EFFECT_FAMILIES.keys()
    assert family_title("torque_scale") == "torque scale or load-dependent friction"
    assert family_title("not_yet_known") == "not yet known"


def test_effects_that_stand_for_a_family_by_their_texts() -> None:
    texts = ("coulomb_friction:joint2", "coulomb_friction:joint1")
    families: dict[str, str] = dict.fromkeys(texts, "dry_friction")
    assert text_names(texts, JOINTS, families) == ["Dry friction on joints 1 and 2"]
    assert text_names(texts, JOINTS, {texts[0]: "dry_friction"}) == [
        "Dry friction on joint2", "Coulomb friction on joint1",
    ]  # fmt: skip
    added = [[], *([text] for text in texts)]
    assert text_runs(added, JOINTS, families)[1][0] == "Dry friction on joints 1 and 2"
    assert len(text_runs(added, JOINTS, {texts[1]: "dry_friction"})) == 3


def test_what_was_tried_is_told_briefly() -> None:
    def add(effect: str, joint: str, delta: float, error: float = 3.0, **changes: Any) -> Move:
        return Move("add", (f"{effect}:{joint}",), (), delta, error, True, "coarse", **changes)

    friction = [add("coulomb_friction", joint, 100.0, 3.0) for joint in JOINTS]
    offset, gap = add("torque_offset", "joint1", 2.0, 1.0), add("backlash", "joint2", 4.0, 9.0)
    refused = [replace(offset, accepted=False, why="within its error"),
               replace(friction[0], accepted=False, delta=5.0),  # accepted later
               replace(gap, accepted=False, resolution="fine", why="at a bound"),
               replace(gap, accepted=False, delta=-4.0)]  # fmt: skip
    drop = Move("drop", (), ("cable_spring:joint2",), 7.0, 2.0, True, "fine")
    unknown = Move("unknown", ("unknown:joint1",), (), 50.0, float("inf"), True, "fine")
    told = told_moves([refused[1], friction[0], refused[3], *friction[1:], *refused, drop, unknown], JOINTS)
    assert [move.line for move in told] == [
        "Coulomb friction on joints 1 and 2 added: 200.0 ± 4.2 nats",
        "Cable spring on joint2 dropped: 7.0 ± 2.0 nats",
        "an unknown torque on joint1 allowed for: 50.00 ± – nats",
        "Backlash on joint2 not added: 4.0 ± 9.0 nats (at a bound)",
        "Torque offset on joint1 not added: 2.0 ± 1.0 nats (within its error)",
    ]
    assert len(told_moves(refused, JOINTS, refused=1)) == 1
    swap = told_moves(TRACE[2:], JOINTS, {"coulomb_friction:joint2": "dry_friction"})[0]  # within the family
    assert swap.text.endswith("at the link on joint2 not put in place of Coulomb friction on joint2")
    contact = Move(
        "episode", ("external_contact:joint1:g2",), (), -3.14, 0.0, False, "coarse", "it is not needed"
    )
    assert told_moves([contact])[0].line.endswith(" not added: −3.14 nats (it is not needed)")
    odd = Move("vary", ("coulomb_friction:joint1",), (), float("nan"), 1.0, False, "fine")
    assert told_moves([odd])[0].text == "vary of Coulomb friction on joint1 not made"
    assert [decoys_text(Decoys(count, 40)) for count in (0, 1, 2)] == [
        "of 40 decoys none was accepted", "of 40 decoys 1 was accepted", "of 40 decoys 2 were accepted",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("because", "hides"),
    [
        ("noise", "the noise of the sensors hides what is smaller"),
        ("filter", "the filter that the recording has passed hides what is smaller"),
        ("resolution", "the resolution of the sensors hides what is smaller"),
        ("tolerance", "the equations of the model are no more accurate"),
    ],
)
def test_nothing_missing_says_down_to_what_that_holds(because: LimitReason, hides: str) -> None:
    complete = replace(DIAGNOSIS, verdict="nothing-missing", limit=DetectionLimit(0.0002, because))
    said = f"This holds down to 0.020 % of the torque: {hides}."
    assert verdict_text(complete).endswith(f"no effect of the library explains any of it. {said}")
    assert complete.to_dict()["limit"] == {"share": 0.0002, "because": because}
    read = ResultDocument.from_dict(complete.to_dict())
    assert read.limit == complete.limit and said in read.summary()
    added = verdict_text(complete, ["Coulomb friction on joint2"])
    assert (
        added.startswith("Added: Coulomb friction on joint2. With it nothing is missing:") and said in added
    )
    unknown = replace(complete, limit=None)
    assert "holds down to" not in verdict_text(unknown) and "limit" not in unknown.to_dict()


def test_a_limit_is_a_share_and_one_of_four_reasons() -> None:
    for wrong in ({"share": -0.1, "because": "noise"}, {"share": 0.1, "because": "weather"}):
        with pytest.raises(ValidationError):
            ResultDocument.from_dict(DIAGNOSIS.to_dict() | {"limit": wrong})


def test_a_stopped_diagnosis_says_so_and_does_not_speak_for_the_library() -> None:
    stopped = replace(DIAGNOSIS, stopped=True)
    missing = verdict_text(stopped)
    assert missing.startswith("Missing: Coulomb friction on joint2") and missing.endswith(STOPPED)
    unknown = verdict_text(replace(stopped, verdict="unknown"))
    assert unknown.startswith("Unknown: no effect tried so far explains") and unknown.endswith(STOPPED)
    assert "of the library" not in unknown and STOPPED not in verdict_text(DIAGNOSIS)
    nothing = replace(stopped, verdict="not-searched", findings=())
    said = "Not searched: the diagnosis was stopped before it tried any effect."
    assert verdict_text(nothing) == said and said in nothing.summary()
    assert ResultDocument.from_dict(nothing.to_dict()).verdict == "not-searched"
