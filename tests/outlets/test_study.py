"""Studies: runs are kept, and their summary agrees with what was put in."""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as papq
import pytest

from flexviz.base.errors import InputError
from flexviz.outlets.batch import ClusterChoice, StudyPlan, StudyRun, run_study, working
from flexviz.outlets.batch.study_page import detected, detection_limit, spreads, study_page
from flexviz.outlets.batch.study_plan import study_tasks
from flexviz.outlets.terminal import main
from tests.small_set import write_small_set

HERE = ClusterChoice(workers=1, processes=False)


def runs(values: Any, std: float, truth: float) -> Iterator[StudyRun]:
    for number, value in enumerate(values, 1):
        entry = {"stiffness:joint1": [float(value), std, "Nm/rad", "yes"]}
        result = {"parameters": entry, "truth": {"stiffness:joint1": truth}, "residual": 0.01}
        yield StudyRun(number, None, number, "", "", result)


def test_bias_spread_and_coverage() -> None:
    values = 1003.0 + 2.0 * np.random.default_rng(1).normal(size=4000)
    (found,) = spreads(list(runs(values, 2.0, 1000.0)))
    assert found.bias == pytest.approx(3.0, abs=0.1) and found.spread == pytest.approx(2.0, rel=0.03)
    inside = 0.5 * (math.erf((1.96 - 1.5) / math.sqrt(2)) + math.erf((1.96 + 1.5) / math.sqrt(2)))
    assert found.coverage == pytest.approx(inside, abs=0.02) and found.claimed == 2.0


def test_the_detection_limit_is_the_end_of_an_unbroken_row() -> None:
    plan = StudyPlan("detection", "planar-2r", 10, ("coulomb_friction:joint2",), "coulomb", (0.0, 0.1, 0.2))
    assert [t.what["hidden"] for t in study_tasks(plan)][::10] == [
        ["none"], ["coulomb_friction:joint2:coulomb=0.1"], ["coulomb_friction:joint2:coulomb=0.2"],
    ]  # fmt: skip
    found = ["coulomb_friction:joint2"]
    seen = [
        StudyRun(i, size, i, "", "", {"found": found if i < right else [], "parameters": {}, "residual": 0.1})
        for size, right in ((0.0, 1), (0.1, 9), (0.2, 3), (0.4, 9), (0.8, 10))
        for i in range(10)
    ]
    counts = detected(plan, seen)
    assert counts == [(0.0, 9, 10), (0.1, 9, 10), (0.2, 3, 10), (0.4, 9, 10), (0.8, 10, 10)]
    assert detection_limit(counts) == 0.4
    page = study_page(plan, seen, dt.datetime(2026, 1, 1))
    assert "From 0.400 on at least 90 %" in page and "With nothing hidden, 1 of 10 name an effect" in page


@pytest.mark.slow
def test_a_bootstrap_draws_blocks_and_a_sweep_tries_bandwidths(tmp_path: Path) -> None:
    folder = write_small_set(tmp_path / "set")
    plan = StudyPlan("bootstrap", str(folder), runs=3, block=0.5)
    done = run_study(plan, tmp_path / "out", HERE)
    assert done.complete and [run.error for run in done.runs] == ["", "", ""]
    values = [run.parameters["viscous_friction_sum:joint1"][0] for run in done.runs]
    assert len(set(values)) == 3 and np.std(values) < 0.2 * np.mean(values)
    again = run_study(StudyPlan("bootstrap", str(folder), runs=4, block=0.5), tmp_path / "out", HERE)
    assert (again.count.kept, again.count.done) == (3, 1)
    table = papq.read_table(tmp_path / "out" / "runs.parquet")
    rows = [row for row in table.to_pylist() if row["parameter"] == "viscous_friction_sum:joint1"]
    assert [row["value"] for row in rows][:3] == values and [row["seed"] for row in rows] == [0, 1, 2, 3]
    arguments = ["study", "bandwidth", str(folder), "--out", str(tmp_path / "w"), "--at", "20", "--at", "30"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("flexviz.outlets.batch.ClusterChoice", lambda *_: HERE)
        assert main(arguments) == 0
    assert "Error against bandwidth" in (tmp_path / "w" / "summary.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_simulated_runs_know_their_truth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done = run_study(StudyPlan("monte-carlo", "paper-f", runs=2, start="moving"), tmp_path / "out", HERE)
    first, second = done.runs
    assert first.truth == second.truth and first.truth["stiffness:joint1"] > 0
    assert first.parameters != second.parameters
    k = "stiffness:joint1"
    assert first.parameters[k][0] == pytest.approx(first.truth[k], rel=0.1)
    monkeypatch.setitem(working.KINDS, "monte-carlo", lambda what, where: {}["lost"])
    broken = run_study(StudyPlan("monte-carlo", "paper-f", runs=3, start="moving"), tmp_path / "out", HERE)
    assert [bool(run.error) for run in broken.runs] == [False, False, True] and broken.count.failed == 1


@pytest.mark.parametrize(
    "given, said",
    [
        ({"kind": "magic"}, "magic"),
        ({"kind": "bandwidth"}, "--at"),
        ({"kind": "detection", "settings": (1.0,)}, "--parameter"),
        ({"kind": "bandwidth", "settings": (0.0,)}, "positive"),
        ({"kind": "monte-carlo", "source": "paper-z"}, "paper-z"),
    ],
)
def test_bad_plans_are_refused(given: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        list(study_tasks(StudyPlan(**{"source": "planar-2r", **given})))
