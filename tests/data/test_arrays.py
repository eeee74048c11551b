"""Measurement sets from arrays and data frames: the same as from files, and checked like them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pytest
import xarray

import flexviz
from flexviz.data.measurements import GroupTable, MeasurementSet, read_set, write_set
from flexviz.data.measurements.data import Segment

ROBOT = "robots:planar_2r"
JOINTS = ("joint1", "joint2")


@pytest.fixture(scope="module")
def demo() -> MeasurementSet:
    return read_set("demo")


@pytest.fixture(scope="module")
def recorded(demo: MeasurementSet) -> Segment:
    return demo.groups[0].segments[0]


def arrays(one: Segment) -> dict[str, Any]:
    return {"time": one.time, "theta": one.theta, "tau": one.tau}


def columns(one: Segment) -> dict[str, Any]:
    """As in a table of a set, the joints in another order."""
    each = {f"{kind}_{joint}": getattr(one, kind)[:, j] for kind in ("tau", "theta") for j, joint in NUMBERED}
    return {**each, "time": one.time}


NUMBERED = [(1, "joint2"), (0, "joint1")]


class Frame:
    """As much of a pandas.DataFrame as is needed: columns, and an index that may be the time."""

    def __init__(self, columns: dict[str, Any], index: Any = None) -> None:
        self.columns, self.index, self._data = list(columns), index, columns

    def keys(self) -> list[str]:
        return self.columns

    def __contains__(self, key: object) -> bool:
        return key in self._data

    def __getitem__(self, key: str) -> Any:
        return self._data[key]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.column_stack(list(self._data.values()))


class Labelled(np.ndarray):
    """As much of an xarray.DataArray: named dimensions and their labels."""

    dims: tuple[str, ...]
    coords: dict[str, Any]


def same(found: MeasurementSet, recorded: Segment) -> bool:
    one = found.groups[0].segments[0]
    return all(
        np.array_equal(getattr(one, name), getattr(recorded, name)) for name in ("time", "theta", "tau")
    )


def test_arrays_give_the_set_that_files_give(demo: MeasurementSet) -> None:
    runs = {group.name: arrays(group.segments[0]) for group in demo.groups}
    made = MeasurementSet.from_arrays(
        ROBOT,
        runs,
        name=demo.name,
        validation=[group.name for group in demo.validation_groups],
        payloads=demo.payloads,
        carried={group.name: group.payload for group in demo.groups},
        torque_hold=demo.torque_hold,
        initial_stiffness=demo.initial_stiffness,
        initial_motor_inertia=demo.initial_motor_inertia,
    )
    assert not made.warnings and [g.name for g in made.validation_groups] == ["t4p2"]
    result, expected = (
        flexviz.identify(one, effects=["coulomb_friction"], refine=False) for one in (made, demo)
    )
    assert [p.value for p in result.parameters] == [p.value for p in expected.parameters]
    assert result.residual.rms_validation == expected.residual.rms_validation


def test_all_kinds_of_tables_are_read_alike(recorded: Segment) -> None:
    swapped = Frame({f"theta_{joint}": recorded.theta[:, j] for j, joint in NUMBERED})
    index: Any = np.array(recorded.time * 1e9, "m8[ns]")
    across = np.ascontiguousarray(recorded.tau.T).view(Labelled)
    across.dims, across.coords = ("joint", "time"), {}
    across.transpose = lambda *order: _with_dims(recorded.tau)  # type: ignore[method-assign,assignment]
    for run in (
        columns(recorded),
        Frame(columns(recorded)),
        {**arrays(recorded), "theta": swapped},
        {**arrays(recorded), "tau": across},
    ):
        assert same(MeasurementSet.from_arrays(ROBOT, run), recorded)
    dated = {name: column for name, column in columns(recorded).items() if name != "time"}
    found = MeasurementSet.from_arrays(ROBOT, Frame(dated, index)).groups[0].segments[0]
    assert np.allclose(found.time, recorded.time - recorded.time[0], atol=1e-9)


def _with_dims(values: np.ndarray) -> Labelled:
    out = values.view(Labelled)
    out.dims, out.coords = ("time", "joint"), {}
    return out


def test_pandas_and_xarray(recorded: Segment) -> None:
    frame = pandas.DataFrame(columns(recorded))
    names = {"time": recorded.time, "joint": ["joint1", "joint2"]}
    both = {kind: (("time", "joint"), getattr(recorded, kind)) for kind in ("theta", "tau")}
    dataset = xarray.Dataset(both, coords=names)
    for run in (frame, frame.set_index("time"), dataset, dataset.isel(joint=[1, 0]).transpose()):
        assert same(MeasurementSet.from_arrays(ROBOT, run), recorded)


def broken(recorded: Segment, row: int, value: float) -> np.ndarray:
    theta = recorded.theta.copy()
    theta[row, 1] = value
    return theta


@pytest.mark.parametrize(
    "change, says",
    [
        (lambda r: {"theta": broken(r, 7, np.nan)}, "row 8 (index 7), column theta_joint2: found nan"),
        (lambda r: {"theta": np.ma.masked_less(r.theta, 0.0)}, "column theta_joint1: found nan"),
        (lambda r: {"theta": r.theta.T}, "theta: has the shape (2, 12000), expected (12000, 2)"),
        (lambda r: {"tau": r.tau[:-1]}, "tau: has the shape (11999, 2), expected (12000, 2)"),
        (lambda r: {"time": r.time[:, None]}, "time: has the shape (12000, 1), expected (12000,)"),
        (lambda r: {"theta": np.degrees(r.theta)}, "are these degrees? expected radians"),
        (lambda r: {"tau": 1e3 * r.tau}, "is this mNm? expected Nm"),
        (lambda r: {"time": 1e3 * r.time}, "is time in milliseconds? expected seconds"),
        (lambda r: {"time": np.round(r.time, 2)}, "time repeats 0 (10799 such rows), expected strictly"),
        (lambda r: {"tau": "none"}, "tau: holds no numbers"),
        (lambda r: {"tau": r.tau * 1j}, "tau: holds no numbers (found complex128)"),
        (lambda r: {"theta": 0.0 * r.theta}, "no joint moves"),
        (lambda r: {"tau": Frame({"a": r.tau[:, 0], "b": r.tau[:, 1]})}, "has columns a, b, expected joint1"),
        (lambda r: {"time": r.time[:9], "theta": r.theta[:9], "tau": r.tau[:9]}, "too few rows: 9"),
    ],
)
def test_bad_arrays_are_refused_in_one_line(recorded: Segment, change: Any, says: str) -> None:
    with pytest.raises(flexviz.InputError) as error:
        MeasurementSet.from_arrays(ROBOT, arrays(recorded) | change(recorded))
    assert says in str(error.value) and str(error.value).startswith(("run", "arrays"))


@pytest.mark.parametrize(
    "data, says",
    [
        (None, "run: is of type NoneType, expected a mapping, a DataFrame or a Dataset"),
        ({}, "there is no run"),
        ({"theta": np.zeros((9, 2))}, "there is no time, expected time, and theta and tau of every joint"),
        ({"time": np.arange(40.0) / 99}, 'column "theta_joint1" is missing (also theta_joint2, tau_joint1'),
    ],
)  # fmt: skip
def test_what_is_no_run_is_refused(data: Any, says: str) -> None:
    with pytest.raises(flexviz.InputError) as error:
        MeasurementSet.from_arrays(ROBOT, data)
    assert says in str(error.value)


@pytest.mark.parametrize(
    "options, says",
    [
        ({"validation": ["rum"]}, 'arrays: group "rum" does not exist; did you mean "run"?'),
        ({"carried": {"run": "p9"}}, 'payload "p9" is not defined'),
        ({"effects": ["colomb_friction"]}, 'did you mean "coulomb_friction"?'),
        ({"initial_stiffness": [1000.0]}, "1 values for 2 joints"),
        ({"gravity": (0.0, 1.0)}, "gravity"),
        ({"joints": ["joint1", "elbow"]}, 'joint "elbow" is not a moving joint'),
    ],
)
def test_bad_properties_are_refused(recorded: Segment, options: Any, says: str) -> None:
    with pytest.raises(flexviz.InputError) as error:
        MeasurementSet.from_arrays(ROBOT, arrays(recorded), **options)
    assert says in str(error.value)


def test_uneven_steps_are_resampled_as_from_files(recorded: Segment, tmp_path: Path) -> None:
    shift = np.random.default_rng(1).uniform(-0.3, 0.3, len(recorded)) * recorded.step
    uneven = {**arrays(recorded), "time": recorded.time + shift}
    before = uneven["theta"].copy()
    found = MeasurementSet.from_arrays(flexviz.Robot.load(ROBOT), uneven)
    assert found.warnings[0].kind == "time-jitters" and np.array_equal(uneven["theta"], before)
    write_set(
        tmp_path / "set",
        robot=ROBOT,
        joints=JOINTS,
        groups=[GroupTable("run", "run", "none", uneven["time"], recorded.theta, recorded.tau)],
        payloads={"none": ()},
    )
    assert same(read_set(tmp_path / "set"), found.groups[0].segments[0])


def test_a_set_of_arrays_can_be_written_and_has_a_hash(recorded: Segment, tmp_path: Path) -> None:
    made = MeasurementSet.from_arrays(ROBOT, {"run.1": arrays(recorded), "run2": columns(recorded)})
    assert made.warnings[0].kind == "same-samples" and made.warnings[0].groups == ("run.1", "run2")
    groups = [GroupTable.of(group) for group in made.groups]
    folder = write_set(tmp_path / "set", robot=ROBOT, joints=JOINTS, groups=groups, payloads=made.payloads)
    assert same(read_set(folder), recorded)
    assert made.files_read is not None and len({file.sha256 for file in made.files_read.files}) == 2
