"""The scripts in examples/ run as shown."""

from __future__ import annotations

import json
import runpy
import subprocess
import sys
from operator import attrgetter
from pathlib import Path

import pytest

from flexviz.analysis.diagnosis import Diagnosis
from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import forget_effects
from tests.cases import with_slow
from tests.planar_arm import shorten_presets

ROOT = Path(__file__).resolve().parent.parent
SCRIPTS = sorted(path for path in (ROOT / "examples").glob("*.py") if path.name != "user_effects.py")
PRINTS = {  # what a reader of the output looks for
    "arrays": "are these degrees? expected radians",
    "bandwidth_sweep": "least held-out error at",
    "batch": "planar-2r-demo,missing,coulomb_friction:joint2",
    "export_model": "feed-forward torque",
    "identify": "95 % interval",
    "live_eso": "ESO's slowest state lags",
    "missing_effect": "+ coulomb_friction on joint2",
    "own_robot": "run3: 12.0 s",
    "user_effect": "forward: 4.000",
}
LONG = "bandwidth_sweep", "batch", "user_effect"
stem = attrgetter("stem")


def test_every_script_is_checked() -> None:
    assert {path.stem for path in SCRIPTS} == set(PRINTS)


@pytest.fixture
def diagnosed(diagnosed_demo: Diagnosis, monkeypatch: pytest.MonkeyPatch) -> None:
    """The diagnosis of the example set is made once for all tests."""

    def known(measurements: MeasurementSet, apply: bool = False) -> Diagnosis:
        assert apply and measurements.name == diagnosed_demo.set_name
        return diagnosed_demo

    monkeypatch.setattr("flexviz.diagnose", known)


@pytest.mark.parametrize("script", with_slow(SCRIPTS, LONG, stem), ids=stem)
def test_example_runs(
    script: Path,
    tmp_path: Path,
    diagnosed: None,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    shorten_presets(monkeypatch)
    if script.stem == "batch":  # its workers import it
        done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        printed = done.stdout
    else:
        monkeypatch.setattr(sys, "argv", [str(script)])
        runpy.run_path(str(script), run_name="__main__")
        forget_effects()
        printed = capsys.readouterr().out
    assert PRINTS[script.stem] in printed


def test_the_notebook_runs(
    tmp_path: Path, diagnosed: None, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    notebook = json.loads((ROOT / "examples" / "notebook.ipynb").read_text(encoding="utf-8"))
    cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert len(cells) >= 4 and all(not cell["outputs"] for cell in notebook["cells"] if "outputs" in cell)
    program = tmp_path / "notebook.py"
    program.write_text("\n".join(cells), encoding="utf-8")
    monkeypatch.chdir(ROOT)
    runpy.run_path(str(program), run_name="__main__")
    printed = capsys.readouterr().out
    assert "Nm/rad" in printed and "3 figures" in printed
