"""What a notebook shows of a result: figures, a table of pandas, Rerun's viewer."""

from __future__ import annotations

import csv
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

import flexviz
from flexviz.analysis.diagnosis import Diagnosis
from flexviz.analysis.identification import Identification
from flexviz.data.measurements import MeasurementSet
from flexviz.outlets.recording import notebook_viewer

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def result(demo: MeasurementSet) -> Identification:
    return flexviz.identify(demo, effects=["coulomb_friction:joint2"])


def titles(svg: str) -> list[str]:
    """The visible titles of a figure, which is well-formed."""
    found = ElementTree.fromstring(svg).findall(f"./{SVG}text")
    return ["".join(one.itertext()) for one in found]


def test_residual_of_one_joint_or_all_with_its_numbers(result: Identification, tmp_path: Path) -> None:
    one = result.plot.residual(joint="joint2")
    assert titles(one._repr_svg_()) == ["Residual of joint2, t4p2"]
    assert titles(result.plot.residual(group="t1p1").svg()) == [
        "Residual of joint1, t1p1",
        "Residual of joint2, t1p1",
    ]
    with one.save(tmp_path / "residual.csv").open() as file:
        head, *rows = csv.reader(file)
    assert head[:2] == ["time [s]", "residual [mNm]"] and head[2] == "95 % of noise, low [mNm]"
    drawn = 1e-3 * max(abs(float(row[1])) for row in rows)
    assert drawn == pytest.approx(np.abs(result.residuals["t4p2"].residual[:, 1]).max())
    assert float(rows[0][3]) == pytest.approx(1960 * result.noise_in("t4p2")[1], rel=1e-3)


def test_law_runs_through_the_data_with_the_known_size(result: Identification, tmp_path: Path) -> None:
    figure = result.plot.law("coulomb_friction", joint="joint2")
    (law, data) = figure.charts[0].series
    assert np.abs(law.y).max() == pytest.approx(3.0, abs=0.02)  # what the simulator hid
    assert np.median(np.abs(data.y)) == pytest.approx(3.0, abs=0.02)
    saved = figure.save(tmp_path / "law.svg").read_text()
    assert titles(saved) == ["Coulomb friction of joint2: its law through the data"]


def test_staircase_law_and_residual_of_a_diagnosis(diagnosed_demo: Diagnosis) -> None:
    plot = diagnosed_demo.plot
    stairs = plot.staircase().charts[0]
    assert [text for _, text in stairs.x.ticks] == ["set's model", "coulomb_friction:joint2"]
    assert all(line.y[0] > 30.0 * line.y[-1] for line in stairs.series if line.label.startswith("t"))
    assert titles(plot.staircase("joint2").svg()) == ["Error after each added effect, joint2"]
    assert titles(plot.law("coulomb_friction").svg()) == [
        "Coulomb friction of joint2: its law through the data"
    ]
    before, explained = plot.residual(joint="joint2").charts[0].series
    assert np.corrcoef(before.y, explained.y)[0, 1] > 0.99


def test_what_cannot_be_drawn_is_said(
    result: Identification, diagnosed_demo: Diagnosis, demo: MeasurementSet, tmp_path: Path
) -> None:
    loaded = replace(result)  # as from a session: without its set
    for draw, says in (
        (lambda: result.plot.law("colomb_friction"), 'did you mean "coulomb_friction:joint2"?'),
        (lambda: result.plot.law("coulomb_friction", joint="joint1"), 'no law of "coulomb_friction:joint1"'),
        (lambda: loaded.plot.law("coulomb_friction"), "expected measurements="),
        (lambda: result.plot.residual(joint="elbow"), 'joint "elbow" is not in the set'),
        (lambda: result.plot.residual(group="t9"), 'group "t9" has no residual'),
        (lambda: result.plot.residual().save(tmp_path / "all.csv"), "choose a joint"),
        (lambda: result.plot.residual().save(tmp_path / "all.png"), "expected .svg or .csv"),
        (lambda: diagnosed_demo.plot.staircase("elbow"), 'joint "elbow" is not in the set'),
        (lambda: diagnosed_demo.plot.residual("joint1"), 'did you mean "joint2"?'),
    ):
        with pytest.raises(flexviz.InputError) as error:
            draw()
        assert says in str(error.value)
    assert loaded.plot.law("coulomb_friction", measurements=demo).charts


def test_to_frame_has_a_row_per_parameter(result: Identification, diagnosed_demo: Diagnosis) -> None:
    for found in (result, result.document(), diagnosed_demo):
        frame = found.to_frame()
        assert list(frame)[4:9] == ["value", "std", "low", "high", "unit"]
        row = frame[(frame["name"] == "stiffness") & (frame["joint"] == "joint2")].iloc[0]
        assert row.low < 1100.0 < row.high or found is not diagnosed_demo
        assert row.high - row.low == pytest.approx(2 * 1.96 * row["std"], rel=1e-4)


def test_missing_packages_are_named(result: Identification, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    monkeypatch.delitem(sys.modules, "pandas", raising=False)
    with pytest.raises(flexviz.MissingPackage, match=r"needs pandas, .* pip install 'pandas'"):
        result.to_frame()
    with pytest.raises(ImportError, match="pip install 'rerun-notebook=="):
        notebook_viewer(Path("demo.rrd"))


def test_a_recording_reaches_the_viewer_of_a_notebook(demo: MeasurementSet, tmp_path: Path) -> None:
    import rerun
    import rerun.notebook

    from flexviz.outlets.recording import recording_file
    from flexviz.outlets.workflows import RecordedAnalysis

    with recording_file(demo, tmp_path / "demo.rrd") as file:
        file.recorder.measured(lambda *_: None)
    shown: list[Any] = []

    def viewer(*, width: Any, height: int, recording: Any) -> str:
        shown.append(rerun.memory_recording(recording))
        return f"{width} × {height}"

    assert file.written is not None
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "rerun_notebook", SimpleNamespace())
        patch.setattr(rerun.notebook, "Viewer", viewer)
        assert RecordedAnalysis(file.written, ()).viewer(height=400) == "auto × 400"
    assert len(shown[0].drain_as_bytes()) > 0.5 * file.written.bytes
