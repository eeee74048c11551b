"""Clocks whose resolution is coarser than the rows are spaced."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from flexviz.data.importing import import_logs
from flexviz.data.logs import CoarseClock
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
    with pytest.raises(Exception, match=re.escape("state step = 0.004 in [time]")):
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
    assert re.search(
        r'\[time\]\ncolumn = "time"\nstep = 0.004  # seconds per row: "time" is coarser', mapping.read_text()
    )


def coarse_log(folder: Path, lost: int = 0) -> tuple[Path, NDArray[np.float64]]:
    """A mapping of a log at 250 Hz with time stamps of 10 ms, of which `lost` rows are missing; its angle."""
    k = np.delete(np.arange(1200), np.arange(600, 600 + lost))
    q = np.sin(0.01 * k)
    columns = np.column_stack([np.round(0.004 * k, 2), q, -q, 3 * q, 2 * q])
    names = "time,theta_1,theta_2,tau_1,tau_2"
    np.savetxt(folder / "log.csv", columns, "%.9f", ",", header=names, comments="")
    joints = "".join(f'[joints.joint{j}]\ntheta = "theta_{j}"\ntau = "tau_{j}"\n' for j in (1, 2))
    text = 'format = 1\nrobot = "robots:planar_2r"\n[time]\ncolumn = "time"\n[[logs]]\nfile = "log.csv"\n'
    (folder / "map.toml").write_text(f'{text}group = "g"\n{joints}')
    return folder / "map.toml", q


def test_the_step_is_set_if_asked(tmp_path: Path) -> None:
    mapping, q = coarse_log(tmp_path)
    with pytest.raises(CoarseClock, match=re.escape("state step = 0.004 in [time]")) as raised:
        import_logs(mapping, None)
    assert str(raised.value.proposal) == "step = 0.004 in [time]"
    done = import_logs(mapping, None, mend=True)
    assert "step = 0.004 in [time]" in done.mended
    table = done.groups[0].table
    np.testing.assert_allclose(table.time, 0.004 * np.arange(1200), atol=1e-9)
    np.testing.assert_allclose(table.theta[:, 0], q, atol=1e-8)


def test_a_stated_step_is_compared_with_the_clock(tmp_path: Path) -> None:
    mapping, _ = coarse_log(tmp_path, lost=50)
    mapping.write_text(mapping.read_text().replace("[time]", "[time]\nstep = 0.004"))
    with pytest.raises(CoarseClock, match="or rows that are spaced by the stated step") as raised:
        import_logs(mapping, None, mend=True)
    assert raised.value.proposal is None


@pytest.mark.parametrize("even", [True, False])
def test_messages_with_coarse_stamps(tmp_path: Path, even: bool) -> None:
    """Even ones have a step; of others the time of recording is taken, if that does not repeat."""
    rng = np.random.default_rng(0)
    steps = np.full(2000, 0.004) if even else rng.uniform(0.002, 0.006, 2000)
    stamps = np.round(np.cumsum(steps), 2)
    for logged, key in ((True, "clock"), (False, None)):
        with pytest.raises(CoarseClock) as raised:
            rows_in_order(stamps, "/joint_states", True, tmp_path / "log.mcap", logged=logged)
        key = "step" if even else key
        assert (raised.value.proposal.key if raised.value.proposal else None) == key
