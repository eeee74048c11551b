"""Recordings that grow with an analysis: results as they come, flushes, failures."""

from __future__ import annotations

import shutil
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexviz.base.errors import FlexvizError, InputError
from flexviz.content.charts import COLOURS, cividis, rgb
from flexviz.model.observers import make_observer
from flexviz.model.simulation.run import Run
from flexviz.outlets.recording import LiveRecording, check_recording
from flexviz.outlets.recording.charts import step_names
from flexviz.outlets.recording.stream import Stream
from flexviz.robot.model import EffectValue
from tests.found import DIAGNOSIS
from tests.recorded import Read, blueprint_of, readable_part
from tests.small_session import small_session


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Any:
    measurements, session = small_session(tmp_path_factory.mktemp("set") / "small")
    return replace(measurements, groups=measurements.groups[:2]), session.analysis.identification


def a_run(group: Any) -> Run:
    """A simulated motion that stays 0.1 rad beside the measured one."""
    segment = group.segments[0]
    zero = np.zeros_like(segment.theta)
    theta = segment.theta + 0.1
    return Run(segment.time, theta, zero, theta, zero, segment.tau, zero, theta, 0.001)


def test_everything_as_it_comes(small: Any, tmp_path: Path) -> None:
    measurements, result = small
    first, second = (group.name for group in measurements.groups)
    recording = LiveRecording(measurements, tmp_path / "live.rrd", samples=100)
    recording.observer(make_observer("eso", 40.0))
    recording.started("as it is")
    for iteration in result.iterations[:-1]:
        recording.iteration(iteration)
    recording.flush()
    shutil.copy(tmp_path / "live.rrd", tmp_path / "meanwhile.rrd")
    recording.identified(result)
    recording.replayed(first, a_run(measurements.groups[0]))
    recording.diagnosed(DIAGNOSIS)
    recording.identified(result, "again")
    recording.mapped(DIAGNOSIS.maps)
    recording.note("a word about it")
    written = recording.close()
    assert written.complete and recording.close() == written
    assert recording.file == written.file == tmp_path / "live.rrd"

    meanwhile = Read(readable_part(tmp_path / "meanwhile.rrd"))
    numbers, costs = meanwhile.line("/results/1/optimiser/cost", "iteration")
    assert list(costs) == [iteration.cost for iteration in result.iterations[:-1]]
    assert not any("residual" in entity for entity in meanwhile.batches)

    content = Read(written.file)
    for number in (1, 2):
        numbers, costs = content.line(f"/results/{number}/optimiser/cost", "iteration")
        assert list(costs) == [iteration.cost for iteration in result.iterations]
        assert list(numbers) == list(range(1, len(costs) + 1))
        seconds, _ = content.line(f"/results/{number}/optimiser/cost")
        assert np.all(np.diff(seconds) >= 0)
        for name, series in result.residuals.items():
            if name in (first, second):
                entity = f"/results/{number}/groups/{name}/residual/joint2"
                stride = -(-len(series.time) // 100)
                np.testing.assert_array_equal(content.line(entity)[1], series.residual[::stride, 1])
    label, value = result.iterations[-1].names[0], result.iterations[-1].values[0]
    name, _, joint = label.partition(":")
    assert content.line(f"/results/1/optimiser/parameters/{name}/{joint}", "iteration")[1][-1] == value
    names = list(content.component("/results/1/optimiser/relative", "SeriesLines:names"))
    _, relative = content.line("/results/1/optimiser/relative", "iteration")
    assert relative.reshape(-1, len(names))[-1, names.index(label.replace(":", " "))] == 1.0
    assert f"/observers/eso-40/{second}/disturbance/joint1" in content.batches
    assert f"/groups/{first}/robots/identified/link2" in content.batches
    assert f"/groups/{second}/robots/identified/link2" not in content.batches
    simulated = content.line(f"/results/1/groups/{first}/simulated/theta/joint1")[1]
    measured = measurements.groups[0].segments[0].theta
    np.testing.assert_array_equal(simulated, measured[:: -(-len(measured) // 100), 0] + 0.1)
    assert content.text("/diagnoses/1/verdict").startswith("> **Missing: Coulomb friction on joint2")
    assert "a word about it" in content.text("/log") and "again" in content.text("/about")
    evidence = DIAGNOSIS.findings[0].evidence
    assert evidence is not None
    _, rows = content.line("/diagnoses/1/evidence/1/g2/signature")
    np.testing.assert_array_equal(rows, evidence.signature[200:])
    assert content.picture("/diagnoses/1/staircase").width > 1000
    views = " ".join(entry[0] for entry in blueprint_of(written.file)["ViewBlueprint:display_name"] if entry)
    for words in ("Residual [Nm] g1, result 2", "Errors step by step", "joint × variable", "Verdict"):
        assert words in views


@pytest.mark.slow
def test_maps_are_drawn(small: Any, tmp_path: Path) -> None:
    measurements, _ = small
    with LiveRecording(measurements, tmp_path / "live.rrd", samples=50) as recording:
        recording.mapped(DIAGNOSIS.maps)
    content = Read(tmp_path / "live.rrd")
    one = DIAGNOSIS.maps[0]
    colours, _ = content.colours("/results/1/map")
    assert list(cividis(max(one.explained, 0.0))) in colours.tolist()
    colours, count = content.colours(f"/results/1/curves/{one.joint}")
    alike = np.abs(colours.astype(int) - rgb(COLOURS.residual)).max(axis=1) < 30
    assert count[alike].sum() > 300  # the mean residual


def test_the_staircase_of_several_diagnoses() -> None:
    """Its steps are the beginnings of one diagnosis after the other: their models say what was added."""
    beginning = DIAGNOSIS.steps[0]
    assert beginning.model is not None
    friction = EffectValue("coulomb_friction", "joint2", {"coulomb": 3.0})
    gap = EffectValue("backlash", "joint1", {"half_width": 0.01})
    models = [
        replace(beginning.model, effects=effects) for effects in ((), (friction,), (friction, gap), (gap,))
    ]
    steps = [replace(beginning, model=model) for model in models]
    assert step_names(steps) == [
        "initial model", "+ Coulomb friction on joint2", "+ Backlash on joint1", "without an effect"
    ]  # fmt: skip
    assert step_names(DIAGNOSIS.steps) == ["initial model", "+ Coulomb friction on joint2"]


def test_calls_from_many_threads(small: Any, tmp_path: Path) -> None:
    measurements, result = small
    recording = LiveRecording(measurements, tmp_path / "live.rrd", samples=50)
    recording.started()

    def tell() -> None:
        for iteration in 20 * list(result.iterations):
            recording.iteration(iteration)
        recording.flush()

    threads = [threading.Thread(target=tell) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    recording.close()
    numbers, _ = Read(tmp_path / "live.rrd").line("/results/1/optimiser/cost", "iteration")
    assert list(numbers) == list(range(1, 4 * 20 * len(result.iterations) + 1))


def test_an_older_recording_stays_until_the_new_one_is_whole(small: Any, tmp_path: Path) -> None:
    measurements, _ = small
    (tmp_path / "live.rrd").write_text("the old one")
    recording = LiveRecording(measurements, tmp_path / "live.rrd", samples=50)
    recording.flush()
    assert (tmp_path / "live.rrd").read_text() == "the old one"
    assert recording.file == tmp_path / "live.unfinished.rrd" and (tmp_path / "live.unfinished.rrd").is_file()
    written = recording.close()
    assert written.file == tmp_path / "live.rrd"
    assert check_recording(written.file).confirmed and not (tmp_path / "live.unfinished.rrd").exists()


def test_a_failure_is_told_and_reaches_nobody_else(
    small: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    measurements, result = small
    heard: list[str] = []
    recording = LiveRecording(measurements, tmp_path / "live.rrd", samples=50, on_failure=heard.append)
    recording.flush()

    def full(stream: Stream) -> None:
        raise OSError("no space left on device")

    monkeypatch.setattr(Stream, "flush", full)
    recording.identified(result)
    with pytest.raises(FlexvizError, match="no space left"):
        recording.flush()
    recording.identified(result)  # nothing happens
    with pytest.raises(FlexvizError, match="no space left"):
        recording.close()
    assert heard == [recording.failure] and "\n" not in recording.failure
    assert Read(readable_part(tmp_path / "live.rrd")).batches


def test_a_folder_that_is_not_there(small: Any, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        LiveRecording(small[0], tmp_path / "nowhere" / "x.rrd")
