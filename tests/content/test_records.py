"""Records: a new field is one line, and what earlier versions wrote still opens."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexviz.analysis.diagnosis import Diagnosis
from flexviz.base.errors import InputError
from flexviz.content.results import read_result
from flexviz.content.session import open_session, save_session
from flexviz.content.session.document import FORMAT
from tests.found import CURVE, DIAGNOSIS, TIED_DIAGNOSIS
from tests.small_set import write_small_set

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "tests" / "fixtures"
PYCACHE = shutil.ignore_patterns("__pycache__")

# file of the product -> a line, and the field that is to stand after it
NEW = {
    "content/records/parameters.py": ("    at_bound: bool = False\n", '    seen: str = "twice"\n'),
    "content/records/findings.py": ("    payload: str | None = None\n", "    weight: Real = math.nan\n"),
    "content/results/fields.py": ("    refined: bool = False\n", '    weather: str = "dry"\n'),
}
ASK = """
import json, sys
from dataclasses import replace
from pathlib import Path
import pyarrow.parquet as papq
from flexviz.outlets.batch.rows import FleetRow
from flexviz.outlets.batch.table import read_table, write_table
from flexviz.content.results import ResultDocument
from flexviz.content.session import open_session, save_session
from tests.found import DIAGNOSIS
from tests.small_session import small_session
work, old = Path(sys.argv[1]), Path(sys.argv[2])
measurements, session = small_session(work / "set")
fit = session.analysis.identification
fit = replace(fit, weather="wet", parameters=tuple(replace(p, seen="once") for p in fit.parameters))
heavy = replace(DIAGNOSIS, findings=tuple(replace(one, weight=2.0) for one in DIAGNOSIS.findings))
analysis = session.analysis.with_identification(fit, session.analysis.settings).with_diagnosis(heavy)
saved = save_session(session.then("more", analysis), measurements, work / "kept")
again = open_session(saved).session.analysis
document = json.loads(json.dumps(fit.to_dict()))
read = ResultDocument.from_dict(document)
nothing = dict.fromkeys(("confidence", "residual", "residual_before", "converged", "seconds"))
texts = dict.fromkeys(("set", "path", "robot", "date", "date_from", "sha256", "description",
    "description_sha256", "key", "state", "error", "verdict", "final_verdict"), "")
row = FleetRow(**nothing, **texts, found=(), parameters={p.label: p for p in fit.parameters})
write_table([row], work / "fleet.parquet")
print(json.dumps({
    "json": [document["weather"], document["parameters"][0]["seen"],
        heavy.to_dict()["candidates"][0]["weight"]],
    "read": [read.weather, read["stiffness", "joint1"].seen],
    "session": [again.identification.weather, again.identification.parameters[0].seen,
        again.diagnosis.findings[0].weight],
    "parquet": papq.read_table(work / "fleet.parquet")["stiffness:joint1:seen"].to_pylist(),
    "table": read_table(work / "fleet.parquet")[0].parameters["stiffness:joint1"].seen,
    "old": ResultDocument.from_dict(json.loads(old.read_text()))["stiffness", "joint1"].seen,
}))
"""


# of a solver option, where it is defined and where the command line says what it does
OPTION = {
    "analysis/identification/settings.py": (
        ("    max_iterations: int = 60\n", "    damping: float = 1.0\n"),
        ("    max_iterations: int\n", "    damping: float\n"),
    ),
    "outlets/terminal/options.py": (
        (
            "    ] = True\n",
            '    damping: Annotated[float, typer.Option(help="How long to try, in s.")] = 1.0\n',
        ),
        ("            refine=self.refine,\n", "            damping=self.damping,\n"),
    ),
}
ASK_OPTION = """
import json, sys
from dataclasses import asdict
from pathlib import Path
import flexviz
from flexviz.outlets.batch import SetOptions
from flexviz.outlets.terminal.options import IdentificationOptions
from flexviz.analysis.identification import fit_settings
from flexviz.content.session import open_session, save_session
from tests.small_session import small_session
work = Path(sys.argv[1])
measurements, session = small_session(work / "set")
typed = IdentificationOptions(damping=2.0).settings()
analysis = session.analysis.with_fit(damping=3.0)
saved = save_session(session.then("more", analysis), measurements, work / "kept")
print(json.dumps({
    "command line": typed.damping,
    "python": fit_settings(typed, damping=4.0).damping,
    "session": open_session(saved).session.analysis.fit.damping,
    "up to date": open_session(saved).session.analysis.up_to_date,
    "batch": flexviz.FitSettings(**json.loads(json.dumps(asdict(SetOptions(typed))))["fit"]).damping,
}))
"""


def answers(work: Path, edits: dict[str, Any], ask: str, *words: Path) -> Any:
    """What a program says with a changed copy of the product: file -> lines, each with what follows it."""
    shutil.copytree(ROOT / "flexviz", work / "changed" / "flexviz", ignore=PYCACHE)
    for name, lines in edits.items():
        file = work / "changed" / "flexviz" / name
        text = file.read_text()
        for line, new in lines:
            assert line in text
            text = text.replace(line, line + new, 1)
        file.write_text(text)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(work / "changed"), str(ROOT)])}
    command = [sys.executable, "-P", "-c", ask, work, *words]
    run = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout)


def test_a_new_solver_option_is_two_files(tmp_path: Path) -> None:
    assert answers(tmp_path, OPTION, ASK_OPTION) == {
        "command line": 2.0, "python": 4.0, "session": 3.0, "up to date": False, "batch": 2.0,
    }  # fmt: skip


def test_a_new_field_is_one_line_and_stands_in_document_session_and_table(tmp_path: Path) -> None:
    edits = {name: [one] for name, one in NEW.items()}
    assert answers(tmp_path, edits, ASK, DATA / "result_format_1" / "identification.json") == {
        "json": ["wet", "once", 2.0],
        "read": ["wet", "once"],
        "session": ["wet", "once", 2.0],
        "parquet": ["once"],
        "table": "once",
        "old": "twice",
    }


@pytest.mark.parametrize("version, expected", [(3, DIAGNOSIS), (4, TIED_DIAGNOSIS), (5, TIED_DIAGNOSIS)])
def test_a_session_of_an_older_format_opens_and_is_saved_as_todays(
    version: int, expected: Diagnosis, tmp_path: Path
) -> None:
    folder = write_small_set(tmp_path / "small")
    shutil.copytree(DATA / f"session_format_{version}", folder, dirs_exist_ok=True)
    packed = json.loads((folder / "session.json").read_text())
    assert packed["format"] == version
    opened = open_session(folder)
    analysis = opened.session.analysis
    assert not opened.changed and opened.session.redoes == "width"
    assert opened.session.notes[0].text == "a note"
    assert analysis.identification is not None and analysis.diagnosis is not None
    words = "a stopgap fitted to the residual" if version == 3 else str(CURVE.note)
    written = analysis.diagnosis.to_dict()
    assert written["free_curve"].pop("note").startswith(words)  # each version's own
    wanted = expected.to_dict()
    del wanted["free_curve"]["note"]
    assert written == wanted
    found = analysis.diagnosis.findings[0]
    assert found.evidence is not None and found.evidence.groups == (("g1", 0, 200), ("g2", 200, 400))
    assert found.parameters["coulomb"].std == 0.01 and found.gain == 400.0
    assert (analysis.fit.gains is not None) == (version > 3)
    assert analysis.identification.gains == analysis.fit.gains
    assert analysis.identification.message.startswith("did not converge; ")
    std = [p.std for p in analysis.diagnosis.parameters if p.name == "link_viscous_friction"]
    assert not np.isfinite(std).any()  # null in documents
    save_session(opened.session, opened.measurements, folder)
    assert json.loads((folder / "session.json").read_text())["format"] == FORMAT
    again = open_session(folder).session.analysis
    assert again.identification is not None and again.diagnosis is not None
    assert again.identification.to_dict() == analysis.identification.to_dict()
    assert np.array_equal(again.identification.covariance, analysis.identification.covariance)
    assert again.settings == analysis.settings and again.fitted == analysis.fitted
    assert again.diagnosis.to_dict() == analysis.diagnosis.to_dict()


def set_analysis(session: Any, value: Any) -> None:
    session["present"]["analysis"] = value


@pytest.mark.parametrize("version", [3, 4])
@pytest.mark.parametrize(
    "spoil",
    [
        lambda session: set_analysis(session, "Popen"),
        lambda session: session["present"].pop("analysis"),
        lambda session: session.update(present=3),
        lambda session: session.update(past=7),
        lambda session: session["present"]["analysis"].update(fitted=5),
        lambda session: session["present"]["analysis"].update(bandwidth="wide"),
        lambda session: session.update(shared=[{"=": "Diagnosis", "decoys": 5}]),
    ],
)
def test_a_spoilt_session_of_an_older_format_says_so(spoil: Any, version: int, tmp_path: Path) -> None:
    folder = write_small_set(tmp_path / "small")
    shutil.copytree(DATA / f"session_format_{version}", folder, dirs_exist_ok=True)
    file = folder / "session.json"
    packed = json.loads(file.read_text())
    spoil(packed)
    file.write_text(json.dumps(packed))
    with pytest.raises(InputError, match=r"session\.json: not "):
        open_session(folder)


def test_an_older_verdict_is_about_data_and_model_only(tmp_path: Path) -> None:
    folder = write_small_set(tmp_path / "small")
    shutil.copytree(DATA / "session_format_3", folder, dirs_exist_ok=True)
    packed = json.loads((folder / "session.json").read_text())
    state = packed["present"]["analysis"]
    state["diagnosed"] = [state["path"], state["roles"], state["effects"]]
    (folder / "session.json").write_text(json.dumps(packed))
    analysis = open_session(folder).session.analysis
    assert analysis.diagnosis_up_to_date
    assert not analysis.with_fit(effects=[]).diagnosis_up_to_date


@pytest.mark.parametrize("kind", ["identification", "diagnosis"])
def test_a_document_of_format_1_is_read_and_written_alike(kind: str) -> None:
    file = DATA / "result_format_1" / f"{kind}.json"
    written = json.loads(file.read_text())
    found = read_result(file).to_dict()
    for part in (written, written.get("model", {})):  # since then without an interval where "no"
        for p in (*part.get("parameters", ()), *part.get("base_parameters", ())):
            p["std"] = None if p["identifiable"] == "no" else p["std"]
    assert found == written
    if kind == "diagnosis":
        assert json.loads(json.dumps(TIED_DIAGNOSIS.to_dict())) == written
