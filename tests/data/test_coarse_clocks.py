"""Clocks whose resolution is coarser than the rows are spaced."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from flexviz.data.logs.clocks import even_step, rows_in_order
from flexviz.outlets.terminal import main

ROUNDINGS: dict[str, Callable[[NDArray[np.float64]], NDArray[np.float64]]] = {
    "nearest": np.round,
    "down": np.floor,
    "up": np.ceil,
}


@pytest.mark.parametrize("rounding", ROUNDINGS)
@pytest.mark.parametrize(
    "step, resolution", [(0.004, 0.01), (0.001, 0.01), (0.002, 0.015625), (1 / 300, 0.01)]
)
@pytest.mark.parametrize("begin", [0.0012, 12.3456, 1.7e9])
def test_the_step_of_even_rows(rounding: str, step: float, resolution: float, begin: float) -> None:
    count = 2000
    instants = np.asarray((begin + step * np.arange(count)) / resolution, np.float64)
    clock = resolution * ROUNDINGS[rounding](instants)
    found = even_step(clock)
    assert found is not None and abs(found - step) * count < 2 * resolution
    if step != 1 / 300:
        assert found == step  # the shortest number


@pytest.mark.parametrize("jitter", [0.0, 3e-3])
def test_rows_that_are_not_even_have_none(jitter: float) -> None:
    rng = np.random.default_rng(0)
    steps = np.full(2000, 0.004)
    if jitter:
        time = np.cumsum(steps) + jitter * rng.uniform(-1, 1, 2000)
    else:
        steps[1000:] = 0.005
        time = np.cumsum(steps)
    assert even_step(0.01 * np.round(time / 0.01)) is None


def test_the_error_states_the_step(tmp_path: Path) -> None:
    time = 0.01 * np.round(0.004 * np.arange(500) / 0.01)
    with pytest.raises(Exception, match=re.escape("state step = 0.004 in [time] instead of its column")):
        rows_in_order(time, "time", False, tmp_path / "log.csv")


def test_a_draft_states_the_step(tmp_path: Path) -> None:
    k = np.arange(1200)
    time, q = np.round(0.004 * k, 2), np.sin(0.01 * k)
    columns = np.column_stack([time, q, -q, 3 * q, 2 * q])
    names = "time,theta_1,theta_2,tau_1,tau_2"
    np.savetxt(tmp_path / "log.csv", columns, "%.6f", ",", header=names, comments="")
    mapping = tmp_path / "map.toml"
    log = str(tmp_path / "log.csv")
    assert main(["import", log, "--robot", "robots:planar_2r", "--mapping", str(mapping), "--yes"]) == 0
    assert re.search(r'\[time\]\nstep = 0.004  # seconds per row: "time" is coarser', mapping.read_text())
