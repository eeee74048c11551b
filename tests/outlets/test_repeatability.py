"""Several recordings of one robot: what comes back, compared with what was put into them."""

from __future__ import annotations

import datetime as dt
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from flexviz.content.records import Grade, ParameterEstimate
from flexviz.model.simulation import make_plan, simulate_plan, write_plan
from flexviz.model.simulation.references import random_fourier
from flexviz.outlets.batch import (
    ClusterChoice,
    FleetRow,
    SetOptions,
    repeatability,
    repeatability_lines,
    run_batch,
)
from flexviz.outlets.batch.page import summary_page
from tests.outlets.test_batch_fleet import row
from tests.planar_arm import HELD_OUT, of_groups

STD = 2.0
COULOMB, LINK, OFFSET = "coulomb_friction:joint2", "link_coulomb_friction:joint2", "torque_offset:joint1"
LABELS = tuple(f"stiffness:joint{k}" for k in range(1, 7))


def stiffness(value: float, identifiable: Grade = "yes") -> ParameterEstimate:
    return ParameterEstimate("stiffness", None, value, STD, "Nm/rad", identifiable)


def recordings(seed: int, count: int, scatter: float = 1.0) -> list[FleetRow]:
    """Recordings of one robot whose values have `scatter` times the stated errors."""
    rng = np.random.default_rng(seed)
    rows = []
    for number in range(count):
        values = {label: stiffness(1000 + scatter * STD * rng.normal()) for label in LABELS}
        one = row("arm", dt.date(2026, 1, 1), values)
        rows.append(replace(one, set=f"arm/run{number + 1}", found=(COULOMB,)))
    return rows


def test_findings_are_counted_with_the_sets_that_lack_them() -> None:
    rows = recordings(1, 5)
    rows[2] = replace(rows[2], found=(COULOMB, OFFSET))
    rows[4] = replace(rows[4], found=())
    (found,) = repeatability(rows)
    assert [(one.text, one.count, one.of, one.everywhere) for one in found.findings] == [
        (COULOMB, 4, 5, False),
        (OFFSET, 1, 5, False),
    ]
    assert found.findings[0].absent == ("arm/run5",)
    assert (
        "  found in some: Coulomb friction on joint2 (4 of 5); Torque offset on joint1 (1 of 5)"
        in repeatability_lines(found)
    )


def test_members_of_a_family_are_one_finding_where_a_recording_does_not_tell_them_apart() -> None:
    rows = recordings(1, 4)
    rows[1] = replace(rows[1], found=(LINK,))
    apart = repeatability(rows)[0].findings
    assert [(one.text, one.count) for one in apart] == [(COULOMB, 3), (LINK, 1)]
    rows[3] = replace(rows[3], families=("dry_friction",))
    (together,) = repeatability(rows)[0].findings
    assert (together.count, together.family) == (4, "dry_friction")
    assert "  found in all: Dry friction on joint2" in repeatability_lines(repeatability(rows)[0])


def test_spread_and_probability_are_those_of_the_closed_form() -> None:
    rows = recordings(2, 5)
    (found,) = repeatability(rows)
    one = next(value for value in found.values if value.parameter == LABELS[0])
    values = np.array([r.parameters[LABELS[0]].value for r in rows])
    chi2 = np.sum((values - values.mean()) ** 2) / STD**2
    assert one.mean == pytest.approx(values.mean()) and one.spread == pytest.approx(values.std(ddof=1))
    assert one.stated == STD and one.ratio == pytest.approx(np.sqrt(chi2 / 4))
    assert one.probability == pytest.approx(stats.chi2(4).sf(chi2))


def test_a_value_that_scatters_more_than_stated_is_named() -> None:
    rows = recordings(3, 6)
    for number, one in enumerate(rows):
        one.parameters[LABELS[1]] = stiffness(1000.0 + 20.0 * number)
    rows[0].parameters[LABELS[2]] = stiffness(500.0, "no")  # not determined there
    del rows[1].parameters[LABELS[2]]
    (found,) = repeatability(rows)
    assert [one.parameter for one in found.values if not one.holds] == [LABELS[1]]
    assert [(one.parameter, one.count) for one in found.values if not one.everywhere] == [(LABELS[2], 4)]
    said = repeatability_lines(found)
    assert (
        "  values that scatter more than their intervals: stiffness, joint2 (spread 3.6 %, 19 × stated)"
        in said
    )
    assert "  values in some only: stiffness, joint3 (4 of 6)" in said
    page = summary_page(rows, "arm", dt.datetime(2026, 1, 2, tzinfo=dt.UTC))
    assert "Repeatability" in page and "scatters 19 × as much as stated" in page
    assert "Coulomb friction on joint2" in page and "6 of 6" in page and "repeats, in 4 of 6" in page


def test_right_intervals_are_seldom_called_too_narrow() -> None:
    """1 % of robots; 6 of 200 or more would have a probability of 2 %. Twice the scatter is found."""

    def named(scatter: float) -> int:
        return sum(
            any(not one.holds for one in repeatability(recordings(seed, 8, scatter))[0].values)
            for seed in range(200)
        )

    assert named(1.0) < 6 and named(2.0) > 180


def test_two_recordings_and_failed_ones_say_nothing() -> None:
    rows = recordings(4, 3)
    assert not repeatability(rows[:2]) and not repeatability([*rows[:2], replace(rows[2], state="failed")])
    assert repeatability(rows)[0].recordings == 3


@pytest.mark.slow
def test_five_recordings_of_a_simulated_arm(tmp_path: Path) -> None:
    """Other motions and noise in each, a ripple in one alone, and viscous friction that changes by 5 %."""
    for k in range(1, 6):
        hidden = ["coulomb_friction:joint2:coulomb=3"]
        hidden += ["torque_ripple:joint1:amplitude=0.5,order=12,phase=0.4"] if k == 3 else []
        plan = of_groups(make_plan("planar-2r", hidden), HELD_OUT, 6.0)
        motions = (
            random_fourier(
                plan.robot, 10 * k + j, centre=[0.4, -0.6], reach=[1.1, 1.4],
                duration=6.0, frequency=np.pi / 3, harmonics=4,
            )
            for j in range(len(plan.groups))
        )  # fmt: skip
        groups = tuple(replace(g, reference=m) for g, m in zip(plan.groups, motions, strict=True))
        viscous = plan.model.motor_viscous_friction * np.array([1.0, 1 + 0.05 * (k - 3)])
        plan = replace(plan, groups=groups, model=replace(plan.model, motor_viscous_friction=viscous))
        write_plan(plan, simulate_plan(plan, k), tmp_path / "arm" / f"run{k}", k)
    done = run_batch(tmp_path / "arm", tmp_path / "out", SetOptions(), ClusterChoice(1, processes=False))
    (found,) = repeatability(done.rows)
    assert found.recordings == 5
    always = {one.text for one in found.findings if one.everywhere}
    assert always == {COULOMB}
    ripple = next(one for one in found.findings if one.text == "torque_ripple:joint1")
    assert ripple.absent == tuple(f"run{k}" for k in (1, 2, 4, 5))
    wide = {one.parameter for one in found.values if not one.holds}
    assert "motor_viscous_friction:joint2" in wide or "viscous_friction_sum:joint2" in wide
    repeated = {one.parameter for one in found.values if one.holds and one.everywhere}
    assert {"stiffness:joint1", "stiffness:joint2", "motor_inertia:joint1"} <= repeated
    assert "Repeatability" in (tmp_path / "out" / "summary.html").read_text(encoding="utf-8")
