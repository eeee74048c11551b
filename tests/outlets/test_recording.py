"""Recordings: what was logged is read back and compared, and files are whole or not there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexviz.analysis.identification import identify
from flexviz.base.errors import ConvergenceError
from flexviz.content.scene import measured_motion, robot_shape, with_replay
from flexviz.content.wording import as_markdown
from flexviz.data.measurements import GroupTable, MeasurementSet, read_set, write_set
from flexviz.model.observers import OBSERVERS, make_observer
from flexviz.model.simulation import replay
from flexviz.outlets.recording import record_set
from flexviz.outlets.recording.paths import path
from flexviz.outlets.recording.signals import broken_at_gaps, stride_for
from tests.recorded import Read, blueprint_of, pose_of
from tests.small_set import write_small_set

FIRST, HELD_OUT = "t1p1", "t4p2"
pytestmark = pytest.mark.filterwarnings("error::rerun.error_utils.RerunWarning")  # it replaces exceptions


@pytest.fixture(scope="module")
def pair(demo: MeasurementSet) -> MeasurementSet:
    return replace(demo, groups=(demo.group(FIRST), demo.group(HELD_OUT)))


@pytest.fixture(scope="module")
def result(pair: MeasurementSet) -> Any:
    return identify(pair)


@pytest.fixture(scope="module")
def recorded(pair: MeasurementSet, result: Any, tmp_path_factory: pytest.TempPathFactory) -> Any:
    steps: list[tuple[str, float]] = []
    file = tmp_path_factory.mktemp("recorded") / "demo.rrd"
    written = record_set(pair, result, file, progress=lambda p: steps.append((p.text, p.share or 0.0)))
    assert written.file == file and written.bytes == file.stat().st_size
    shares = [share for _, share in steps]
    assert np.diff(shares).min() > -1e-9 and shares[0] == 0.0 and shares[-1] == 1.0
    return written


@pytest.fixture(scope="module")
def content(recorded: Any) -> Read:
    return Read(recorded.file)


def test_measured_signals(pair: MeasurementSet, content: Read) -> None:
    for group in pair.groups:
        segment = group.segments[0]
        stride = stride_for(group.samples, 10_000)
        for j, joint in enumerate(pair.joints):
            for name in ("theta", "tau"):
                instants, values = content.line(path("groups", group.name, "measured", name, joint))
                np.testing.assert_allclose(instants, segment.time[::stride], atol=2e-9)
                np.testing.assert_array_equal(values, getattr(segment, name)[::stride, j])


def test_all_observer_states(pair: MeasurementSet, result: Any, content: Read) -> None:
    observer = make_observer(result.observer_name, result.bandwidth)
    names = [("theta", k) for k in range(5)] + [("tau", k) for k in range(3)]
    used = f"butterworth-zero-phase-{result.bandwidth:.6g}"
    for group in pair.groups:
        states = observer.states(group.segments[0], pair.torque_hold)
        stride = stride_for(group.samples, 10_000)
        for kind, inside in (("states", True), ("transients", False)):
            rows = np.flatnonzero(states.valid == inside)[::stride]
            assert len(rows) > 10
            for name, order in names:
                for j, joint in enumerate(pair.joints):
                    apart = ("transients",) if kind == "transients" else ()
                    entity = path("observers", used, group.name, *apart, f"{name}_{order}", joint)
                    instants, values = content.line(entity)
                    expected = getattr(states, name)[order][rows, j]
                    if kind == "states":
                        np.testing.assert_allclose(instants, states.time[rows], atol=2e-9)
                        np.testing.assert_array_equal(values, expected)
                    else:  # start and end, with a NaN between them
                        np.testing.assert_array_equal(values[np.isfinite(values)], expected)
                        assert np.count_nonzero(np.isnan(values)) == 1


def test_residual_and_iterations(pair: MeasurementSet, result: Any, content: Read) -> None:
    for name, series in result.residuals.items():
        for j, joint in enumerate(pair.joints):
            for signal_name in ("residual", "torque", "q"):
                instants, values = content.line(path("results", "1", "groups", name, signal_name, joint))
                np.testing.assert_allclose(instants, series.time, atol=2e-9)
                np.testing.assert_array_equal(values, getattr(series, signal_name)[:, j])
    numbers = np.arange(len(result.iterations)) + 1
    for name in ("cost", "step"):
        index, values = content.line(f"/results/1/optimiser/{name}", "iteration")
        np.testing.assert_array_equal(index, numbers)
        np.testing.assert_array_equal(values, [getattr(iteration, name) for iteration in result.iterations])
        seconds, _ = content.line(f"/results/1/optimiser/{name}")
        assert np.all(np.diff(seconds) > 0) and seconds[-1] == pytest.approx(result.seconds)
    _, falling = content.line("/results/1/optimiser/log10_cost", "iteration")
    assert falling[0] == 0.0 and falling[-1] < -0.3 and np.all(np.diff(falling) <= 1e-3)
    last = result.iterations[-1]
    for name, value in zip(last.names, last.values, strict=True):
        parameter, _, joint = name.partition(":")
        index, values = content.line(
            path("results", "1", "optimiser", "parameters", parameter, joint), "iteration"
        )
        rows = [i for i, iteration in enumerate(result.iterations) if name in iteration.names]
        np.testing.assert_array_equal(index, numbers[rows])
        assert values[-1] == value
    ends = content.component("/results/1/optimiser/interval", "Scalars:scalars")
    stiffness = result["stiffness", pair.joints[0]]
    half = 1.96 * stiffness.std / last.values[last.names.index(stiffness.label)]
    assert any(
        low == pytest.approx(1 - half) and high == pytest.approx(1 + half)
        for low, high in zip(ends[::2], ends[1::2], strict=True)
    )
    stages = content.component("/results/1/optimiser/stage", "StateChange:state")
    assert list(stages) == [iteration.stage for iteration in result.iterations]
    lanes = content.component("/results/1/optimiser/stage", "StateConfiguration:values")
    assert list(lanes) == list(dict.fromkeys(stages))
    where = path("results", "1", "estimates", "stiffness", pair.joints[0])
    assert content.component(where, "value")[0] == stiffness.value
    assert content.component(where, "variance")[0] == pytest.approx(stiffness.std**2)
    assert content.component(where, "unit")[0] == "Nm/rad"


def test_a_mounted_robot_is_recorded_as_it_is_mounted(pair: MeasurementSet, tmp_path: Path) -> None:
    robot = pair.robot.mounted((9.81, 0.0, 0.0))
    content = Read(record_set(replace(pair, robot=robot), None, tmp_path / "wall.rrd").file)
    root, prefix = path("groups", FIRST, "robots", "measured"), f"measured/{FIRST}/"
    frames, theta = content.frames(root), measured_motion(pair, pair.group(FIRST), None).theta
    base = pose_of(frames, prefix + "base", 0)
    for row in (0, 137):
        for link, pose in robot.link_poses(theta[row]).items():
            pose[:3, 3] += base[:3, 3]
            np.testing.assert_allclose(pose_of(frames, prefix + link, row), pose, atol=1e-6)
    assert base[2, 0] == pytest.approx(-1.0)  # its x, along which things fall, points down
    trail = np.array(content.component(f"{root}/trail", "LineStrips3D:strips").tolist()).reshape(-1, 3)
    tip = [robot.link_poses(row)[robot_shape(robot).tip][:3, 3] for row in theta]
    np.testing.assert_allclose(trail @ base[:3, :3].T, tip, atol=1e-5)
    (label,) = content.component(f"{root}/label", "Points3D:positions").reshape(-1, 3) @ base[:3, :3].T
    assert label[2] > 0.1 and np.abs(label[:2]).max() < 1e-6


def test_both_robots_move(pair: MeasurementSet, result: Any, content: Read) -> None:
    group = pair.group(FIRST)
    run = replay(
        pair.robot,
        result.model,
        group,
        pair.kp,
        pair.kd,
        torque_hold=pair.torque_hold,
    )
    motion = with_replay(measured_motion(pair, group, result), run)
    assert motion.model_theta is not None
    offsets = []
    for name, theta in (("measured", motion.theta), ("identified", motion.model_theta)):
        root, prefix = path("groups", FIRST, "robots", name), f"{name}/{FIRST}/"
        frames = content.frames(root)
        assert frames[f"{prefix}base"].parent is None  # the scene's
        assert {frame.removeprefix(prefix) for frame in frames} == {"base", "link1", "link2"}
        offsets.append(frames[f"{prefix}base"].places[0])
        for entity, link in (("trail", "base"), ("label", "base"), ("link1", "link1"), ("link2", "link2")):
            assert content.component(f"{root}/{entity}", "CoordinateFrame:frame") == [prefix + link]
        for link in ("link1", "link2"):
            assert len(frames[prefix + link].places) == len(motion.time)
            for row in (0, 137, len(motion.time) - 1):
                expected = pair.robot.link_poses(theta[row])[link]
                expected[:3, 3] += offsets[-1]
                np.testing.assert_allclose(pose_of(frames, prefix + link, row), expected, atol=1e-6)
            entity = f"{root}/{link}"
            vertices = content.component(entity, "Mesh3D:vertex_positions")
            faces = content.component(entity, "Mesh3D:triangle_indices")
            assert len(vertices) > 20 and faces.max() < len(vertices)
            normals = content.component(entity, "Mesh3D:vertex_normals")
            outwards = vertices[faces] - np.mean(vertices[faces], axis=(0, 1))
            assert np.mean(np.sum(normals[faces] * outwards, axis=-1) > 0.0) > 0.7
    assert np.linalg.norm(offsets[0] - offsets[1]) > 1.0
    for j, joint in enumerate(pair.joints):
        instants, values = content.line(path("results", "1", "groups", FIRST, "simulated", "theta", joint))
        stride = stride_for(len(run.time), 10_000)
        np.testing.assert_array_equal(values, run.theta[::stride, j])
        assert len(instants) == len(values)
    heavier = [
        entity for entity in content.batches if f"/{HELD_OUT}/" in entity and entity.endswith("payload\\ 1")
    ]
    assert len(heavier) == 2
    carried = {frame for entity in heavier for frame in content.component(entity, "CoordinateFrame:frame")}
    assert carried == {f"{name}/{HELD_OUT}/link2" for name in ("measured", "identified")}
    assert len(content.frames("/groups")) == 2 * 2 * 3  # no two robots, in no two groups, share a frame


def test_simulated_data_are_called_simulated(content: Read) -> None:
    assert "simulated data" in content.component("/__properties", "RecordingInfo:name")[0].lower()
    assert content.component("/__properties/flexviz", "simulated")[0]
    assert "Simulated data" in content.text("/about")
    assert "Simulated data" in content.text(path("groups", FIRST, "about"))
    label = content.component(path("groups", FIRST, "robots", "measured", "label"), "Points3D:labels")
    assert label[0] == "measured (simulated data)"


def test_words(pair: MeasurementSet, result: Any, content: Read) -> None:
    summary = content.text("/results/1/about")
    assert "stiffness" in summary and "identifiable" in summary and result.observer_name in summary
    assert "used for validation only" in content.text(path("groups", HELD_OUT, "about"))
    assert "closed loop" in content.text(path("groups", FIRST, "about")) or pair.kp is None
    assert as_markdown("a_b|c*") == "a\\_b\\|c\\*"


def test_blueprint(recorded: Any) -> None:
    values = blueprint_of(recorded.file)
    assert ["time"] in values["TimePanelBlueprint:timeline"]
    assert ["iteration"] in values["DataframeQuery:timeline"]
    views = [entry[0] for entry in values["ViewBlueprint:class_identifier"] if entry]
    assert (
        views.count("3D") == 2 and "TimeSeries" in views and "Dataframe" in views and "TextDocument" in views
    )
    names = " ".join(entry[0] for entry in values["ViewBlueprint:display_name"] if entry)
    for words in ("3D t1p1", "d⁴θ/dt⁴", "Residual [Nm]", "Cost", "Step", "Parameters", "About"):
        assert words in names


# -- other sets --------------------------------------------------------------------------------------


def test_without_identification_and_with_gaps(tmp_path: Path) -> None:
    """Only what was measured; the ESO's disturbance; names of any kind; lines broken at gaps; decimated."""
    small = read_set(write_small_set(tmp_path / "small"))
    name = "a/b θ *[x]"
    group = GroupTable.of(small.groups[0])
    keep = np.r_[0:900, 1000:2000]
    assert group.q is not None
    cut = {signal: getattr(group, signal)[keep] for signal in ("time", "theta", "tau", "q")}
    table = replace(group, name=name, file="a.csv", **cut)
    write_set(
        tmp_path / "odd",
        robot="robot.urdf",
        joints=small.joints,
        groups=[table],
        payloads={"p1": ()},
        files={"robot.urdf": small.robot.urdf_path},
    )
    odd = read_set(tmp_path / "odd")
    observer = make_observer("eso", 100.0)
    record_set(odd, None, tmp_path / "x.rrd", observer=observer, samples=500)
    content = Read(tmp_path / "x.rrd")
    instants, values = content.line(path("groups", name, "measured", "theta", "joint1"))
    assert len(values) == 225 + 250 + 1 and np.isnan(values[225]) and np.all(np.diff(instants) > 0)
    _, q = content.line(path("groups", name, "measured", "q", "joint1"))
    assert np.isfinite(q).sum() == 475
    assert path("groups", name, "measured", "q", "joint2") not in content.batches
    states = [observer.states(segment) for segment in odd.groups[0].segments]
    _, disturbance = content.line(path("observers", "eso-100", name, "disturbance", "joint2"))
    expected = np.concatenate(
        [s.disturbance[np.flatnonzero(s.valid)[::4], 1] for s in states if s.disturbance is not None]
    )
    np.testing.assert_array_equal(disturbance[np.isfinite(disturbance)], expected)
    assert not any("results" in entity or "identified" in entity for entity in content.batches)
    assert "Nothing is identified" in content.text("/about") and "Simulated" not in content.text("/about")
    assert not content.component("/__properties/flexviz", "simulated")[0]


def test_a_model_that_diverges_is_still_recorded(
    pair: MeasurementSet, result: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def diverges(*arguments: Any, **options: Any) -> None:
        raise ConvergenceError("the simulation diverged at 1 s")

    monkeypatch.setattr("flexviz.model.simulation.replay", diverges)
    record_set(pair, result, tmp_path / "x.rrd", samples=200)
    content = Read(tmp_path / "x.rrd")
    assert "diverged at 1 s" in content.text(path("groups", FIRST, "about"))
    assert path("groups", FIRST, "robots", "measured", "link1") in content.batches
    assert path("groups", FIRST, "robots", "identified", "link1") not in content.batches


@pytest.mark.parametrize("name", OBSERVERS)
def test_no_view_of_states_is_empty(name: str, tmp_path: Path) -> None:
    """Only an observer with a disturbance state has a view of it, and every view has lines to show."""
    small = read_set(write_small_set(tmp_path / "small"))
    group = small.groups[0]
    observer = make_observer(name, 100.0)
    assert observer.has_disturbance_state == (observer.states(group.segments[0]).disturbance is not None)
    record_set(replace(small, groups=(group,)), None, tmp_path / "x.rrd", observer=observer, samples=100)
    entities = Read(tmp_path / "x.rrd").batches
    queries = [entry[0] for entry in blueprint_of(tmp_path / "x.rrd")["ViewContents:query"] if entry]
    shown = [query for query in queries if "/observers/" in query]
    assert len(shown) == 8 + observer.has_disturbance_state
    for query in shown:
        first = query.split()[0].removeprefix("+").removesuffix("/**")
        assert any(entity.startswith(first + "/") for entity in entities), query


# -- parts -------------------------------------------------------------------------------------------


def test_gaps_and_strides() -> None:
    time_, values = broken_at_gaps(np.array([0.0, 1, 2, 9, 10]), np.ones((5, 2)))
    np.testing.assert_array_equal(time_, [0, 1, 2, 5.5, 9, 10])
    assert np.isnan(values[3]).all() and np.isfinite(np.delete(values, 3, axis=0)).all()
    assert [stride_for(n, 100) for n in (1, 100, 101, 1000)] == [1, 1, 2, 10]
