"""The scripts in examples/ run as shown, each in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SCRIPTS = sorted(path for path in (ROOT / "examples").glob("*.py") if path.name != "user_effects.py")
PRINTS = {  # what a reader of the output looks for
    "bandwidth_sweep": "least held-out error at",
    "batch": "planar-2r-demo,missing,coulomb_friction:joint2",
    "export_model": "feed-forward torque",
    "identify": "95 % interval",
    "live_eso": "ESO's slowest state lags",
    "missing_effect": "+ coulomb_friction on joint2",
    "own_robot": "run3: 12.0 s",
    "user_effect": "forward: 4.000",
}


def test_every_script_is_checked() -> None:
    assert {path.stem for path in SCRIPTS} == set(PRINTS)


@pytest.mark.slow
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_example_runs(script: Path, tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, str(script)], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert PRINTS[script.stem] in done.stdout


@pytest.mark.slow
def test_the_notebook_runs(tmp_path: Path) -> None:
    notebook = json.loads((ROOT / "examples" / "notebook.ipynb").read_text(encoding="utf-8"))
    cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert len(cells) >= 4 and all(not cell["outputs"] for cell in notebook["cells"] if "outputs" in cell)
    program = tmp_path / "notebook.py"
    program.write_text("\n".join(cells), encoding="utf-8")
    done = subprocess.run([sys.executable, str(program)], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "Nm/rad" in done.stdout
