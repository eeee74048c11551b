"""Drift and outliers of a fleet, compared with what was put into it."""

from __future__ import annotations

import datetime as dt
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as papq
import pytest

from flexviz.content.records import Grade, ParameterEstimate
from flexviz.outlets.batch import FleetRow, drift_text, histories, outliers
from flexviz.outlets.batch.page import found_text, summary_page
from flexviz.outlets.batch.table import read_table, write_table

LABELS = ("stiffness:joint1", "stiffness:joint2", "viscous_friction_sum:joint1")
STD = 2.0


def stiffness(value: float, identifiable: Grade = "yes") -> ParameterEstimate:
    return ParameterEstimate("stiffness", None, value, STD, "Nm/rad", identifiable)


def fleet(seed: int, robots: int, months: int, spread: float, slope: float = 0.0) -> list[FleetRow]:
    """A set per robot and month; the stiffness of the first robot's joint 1 changes by `slope` per day."""
    rng = np.random.default_rng(seed)
    rows = []
    for robot in range(robots):
        own = 1000 + spread * rng.normal(size=len(LABELS))
        for month in range(months):
            day = dt.date(2025, 1, 10) + dt.timedelta(days=30 * month)
            values = own + STD * rng.normal(size=len(LABELS))
            values[0] += slope * 30 * month if robot == 0 else 0.0
            parameters = {label: stiffness(float(value)) for label, value in zip(LABELS, values, strict=True)}
            rows.append(row(f"robot{robot}", day, parameters))
    return rows


def row(robot: str, day: dt.date, parameters: dict[str, ParameterEstimate]) -> FleetRow:
    return FleetRow(
        set=f"{robot}/{day}", path="", robot=robot, date=day.isoformat(), date_from="set", sha256="",
        description="arm.urdf", description_sha256="1", key="", state="done", error="", verdict="missing",
        final_verdict="nothing-missing", found=("coulomb_friction:joint2",), confidence=0.9, residual=0.01,
        residual_before=0.2, converged=True, seconds=1.0, parameters=parameters,
    )  # fmt: skip


def test_a_drift_is_found_with_its_slope() -> None:
    rows = fleet(1, robots=3, months=12, spread=20.0, slope=-0.2)
    (found,) = [one for one in histories(rows) if one.drifts]
    assert (found.robot, found.parameter) == ("robot0", LABELS[0])
    assert found.slope == pytest.approx(-0.2, abs=4 * found.slope_std)
    days = 30.0 * np.arange(12)
    assert found.slope_std >= STD / np.sqrt(np.sum((days - days.mean()) ** 2)) * 0.999  # closed form
    assert "Drifts by −6.5 % in 330 days" in drift_text(found)
    assert not outliers(rows)  # three robots are too few to compare


def test_an_outlier_is_found_and_not_its_neighbours() -> None:
    rows = fleet(2, robots=30, months=1, spread=10.0)
    rows[7].parameters[LABELS[1]] = stiffness(800.0)
    rows[9].parameters[LABELS[1]] = stiffness(500.0, "no")  # the data do not determine it
    (found,) = outliers(rows)
    assert (found.row, found.parameter, found.value, found.of) == (7, LABELS[1], 800.0, 29)
    assert found.median == pytest.approx(1000, abs=10) and -30 < found.deviations < -10
    page = summary_page(rows, "<arms>", dt.datetime(2026, 1, 2, tzinfo=dt.UTC))
    assert "&lt;arms&gt;" in page and "robot7/2025-01-10" in page and "Coulomb friction on joint2" in page


def test_a_family_is_named_where_the_data_do_not_tell_its_members_apart(tmp_path: Path) -> None:
    told = row("robot0", dt.date(2025, 1, 10), {})
    untold = replace(told, families=("dry_friction",))
    assert (found_text(told), found_text(untold)) == ("Coulomb friction on joint2", "Dry friction on joint2")
    page = summary_page([told, untold], "arms", dt.datetime(2026, 1, 2, tzinfo=dt.UTC))
    assert "Coulomb friction 1, Dry friction 1." in page
    file = tmp_path / "results.parquet"
    write_table([told, untold], file)
    assert read_table(file) == [told, untold]
    earlier = papq.read_table(file).drop_columns(["families"])
    papq.write_table(earlier, file)
    assert [one.families for one in read_table(file)] == [(), ()]


def test_false_alarms_are_as_rare_as_stated() -> None:
    """1 % of fleets in which nothing happens; 6 of 200 or more would have a probability of 2 %."""
    drifting = sum(any(one.drifts for one in histories(fleet(s, 4, 8, 10.0))) for s in range(200))
    apart = sum(bool(outliers(fleet(s, 12, 2, 10.0))) for s in range(200))
    alone = sum(bool(outliers(fleet(s, 1, 20, 0.0))) for s in range(200))
    assert drifting < 6 and apart < 6 and alone < 6


def test_few_dates_give_no_slope_and_values_on_one_day_no_drift() -> None:
    few = histories(fleet(3, robots=1, months=3, spread=0.0, slope=-5.0))
    assert not any(one.drifts for one in few) and all(np.isnan(one.slope) for one in few)
    assert "too few dates" in drift_text(few[0])
