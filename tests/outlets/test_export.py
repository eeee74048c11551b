"""Exported parameters, reading results again, and the command."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ruamel.yaml import YAML

from flexviz import export
from flexviz.analysis.identification import Identification, identify
from flexviz.base.errors import InputError
from flexviz.content.results import read_result
from flexviz.content.session import Session, save_session
from flexviz.data.measurements import MeasurementSet, fingerprint, read_set
from flexviz.model.effects import EFFECT_NAMES
from flexviz.outlets.exporting import FORMATS, identified_robot, write
from flexviz.outlets.exporting.identified import model_of
from flexviz.outlets.terminal import main
from flexviz.robot.model import FlexibleModel
from tests.exporting_cases import document, identified, plan, short_set
from tests.outlets.test_view_diagnosis import DIAGNOSIS, STEP
from tests.small_set import write_small_set


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = write_small_set(tmp_path_factory.mktemp("export") / "small")
    toml = made / "measurements.toml"  # its torque has no motor inertia in it
    toml.write_text(toml.read_text().replace("torque_hold", 'torque = "motor"\ntorque_hold'))
    return made


@pytest.fixture(scope="module")
def small(folder: Path) -> MeasurementSet:
    return read_set(folder)


@pytest.fixture(scope="module")
def found(small: MeasurementSet) -> Identification:
    return identify(small, effects=["torque_offset:joint2"], refine=False)


@pytest.fixture(scope="module")
def planar(tmp_path_factory: pytest.TempPathFactory) -> MeasurementSet:
    return short_set("planar-2r", tmp_path_factory.mktemp("planar"))


def same(one: FlexibleModel, other: FlexibleModel) -> bool:
    """Every number and every effect, exactly."""
    names = "stiffness", "motor_inertia", "link_viscous_friction", "motor_viscous_friction", "inertial"
    numbers = all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)
    return numbers and one.effects == other.effects and one.joints == other.joints


# -- parameters ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["json", "yaml"])
def test_parameters_read_again_give_the_same(
    name: str, small: MeasurementSet, found: Identification, tmp_path: Path
) -> None:
    (file,) = export(small, found, tmp_path / "out", [name]).files[name]
    again = read_result(file)
    assert same(model_of(again, small.joints, file), found.model)
    assert again.set_sha256 == fingerprint(small).sha256
    # and what is exported of what was exported is the same file
    (second,) = export(small, again, tmp_path / "twice", [name]).files[name]
    assert second.read_bytes() == file.read_bytes()


def test_parameters_say_everything(small: MeasurementSet, found: Identification, tmp_path: Path) -> None:
    out = export(small, found, tmp_path / "out", ["json"]).files["json"][0]
    content = json.loads(out.read_text(encoding="utf-8"))
    given = found.to_dict()
    assert (content["set"], content["joints"], content["simulated"]) == ("small", ["joint1", "joint2"], False)
    assert content["observer"] == given["observer"] and content["groups"] == ["g1", "g2"]
    for mine, theirs in zip(content["parameters"], given["parameters"], strict=True):
        assert {"unit", "std", "identifiable", "tied_to"} <= mine.keys()
        assert {key: mine[key] for key in theirs if key != "start"} == {
            key: value for key, value in theirs.items() if key != "start"
        }
    assert content["base_parameters"] == given["base_parameters"]
    offset = next(e for e in content["effects"] if e["effect"] == "torque_offset")
    known = next(p for p in found.parameters if p.name == "torque_offset.offset")
    assert offset["equation"] == "u = f_0" and offset["joint"] == "joint2"
    assert offset["parameters"]["offset"]["std"] == known.std > 0
    assert offset["parameters"]["offset"]["unit"] == "Nm"


def test_every_effect_comes_back(planar: MeasurementSet, tmp_path: Path) -> None:
    model = plan("planar-2r", *EFFECT_NAMES).model
    done = write(identified(planar, model), tmp_path / "out", ["json", "yaml"])
    for name in ("json", "yaml"):
        assert same(model_of(read_result(done.files[name][0]), planar.joints, "x"), model)


def test_yaml_is_the_json_for_old_and_new_readers(planar: MeasurementSet, tmp_path: Path) -> None:
    """Programs that read YAML 1.1 take `yes` for a truth value and 1e-05 for a text, if they are let."""
    model = plan("planar-2r", "coulomb_friction").model
    tiny = replace(model, motor_viscous_friction=np.array([1e-5, 2.5e-17]), stiffness=np.array([1e20, 900.0]))
    done = write(identified(planar, tiny), tmp_path / "out", ["json", "yaml"])
    expected = json.loads(done.files["json"][0].read_text(encoding="utf-8"))
    for version in ((1, 1), (1, 2)):
        reader = YAML(typ="safe", pure=True)
        reader.version = version
        assert reader.load(done.files["yaml"][0].read_text(encoding="utf-8")) == expected


def test_a_diagnosis_is_exported_by_its_final_model(
    small: MeasurementSet, found: Identification, tmp_path: Path
) -> None:
    """Its JSON lists effects with their own errors, of payloads and groups too."""
    model = plan("planar-2r", "coulomb_friction:joint1", "payload_error", "external_contact").model
    model = replace(model, inertial=found.model.inertial)
    effects = [
        {
            "effect": e.effect, "joint": e.joint, "group": e.group, "payload": e.payload,
            "parameters": {k: {"value": v, "std": 0.25, "unit": "-"} for k, v in e.parameters.items()},
        }
        for e in model.effects
    ]  # fmt: skip
    parameters = [p for p in found.parameters if "." not in p.name]
    diagnosis = replace(DIAGNOSIS, effects=tuple(effects), parameters=tuple(parameters), model=model)
    diagnosis = replace(diagnosis, steps=(*diagnosis.steps, replace(STEP, verdict="nothing-missing")))
    out = export(small, diagnosis, tmp_path / "out", ["json"]).files["json"][0]
    content = json.loads(out.read_text(encoding="utf-8"))
    assert content["verdict"] == "nothing-missing"  # the first model's was "missing"
    assert [e["effect"] for e in content["effects"]] == [e.effect for e in model.effects]
    assert all(v["std"] == 0.25 for e in content["effects"] for v in e["parameters"].values())
    file = tmp_path / "diagnosis.json"
    file.write_text(json.dumps(diagnosis.to_dict()), encoding="utf-8")
    assert read_result(file).final_verdict == "nothing-missing"
    again = model_of(read_result(file), small.joints, file)
    assert again.effects == model.effects
    assert np.array_equal(again.inertial, found.model.inertial)


def test_remarks(small: MeasurementSet, found: Identification, tmp_path: Path) -> None:
    doubtful = replace(found, converged=False, stopped=True)
    made = identified_robot(small, doubtful)
    assert len(made.remarks) == 2 and "did not converge" in made.remarks[0]
    older = identified_robot(small, document(found.model, set_sha256="0" * 64))
    assert older.remarks == ("The measurement set has changed since this identification.",)
    done = write(made, tmp_path / "out")
    for files in done.files.values():
        text = " ".join(b" ".join(file.read_bytes() for file in files).decode().replace("\n *", " ").split())
        assert "The identification did not converge: do not rely on these values." in text


# -- results that are not right ------------------------------------------------------------------------------


def spoiled(result: dict[str, Any], how: str) -> Any:
    """A result with one thing wrong in it."""
    parameters = result["parameters"]
    if how == "no parameters":
        return {"format": 1}
    if how == "a list":
        return [1, 2]
    if how == "infinite":
        parameters[3]["value"] = float("inf")
    if how == "text":
        parameters[3]["value"] = "12"
    if how == "missing":
        del parameters[5]
    if how == "twice":
        parameters.append(parameters[5])
    if how == "joint":
        parameters[5]["joint"] = "joint7"
    if how == "effect":
        parameters[-3]["name"] = "torque_offfset.offset"
    if how == "effect parameter":
        parameters[-3]["name"] = "torque_offset.size"
    if how == "format":
        result["format"] = 2
    return result


@pytest.mark.parametrize(
    "how, says",
    [
        ("no parameters", 'holds no "parameters"; expected what "flexviz identify --json"'),
        ("a list", 'holds no "parameters"'),
        ("infinite", "parameters, entry 4, value: found "),
        ("text", 'parameters, entry 4, value: found "12", expected a number'),
        ("missing", "parameter ixy of joint1 is missing"),
        ("twice", "parameter ixy:joint1 is given twice"),
        ("joint", 'parameter ixy: joint "joint7" is not in the set; did you mean "joint'),
        ("effect", 'effect "torque_offfset" does not exist; did you mean "torque_offset"'),
        ("effect parameter", "effect torque_offset:joint2: parameters size, expected offset"),
        ("format", "format"),
    ],
)
def test_wrong_results_are_named(
    how: str, says: str, folder: Path, found: Identification, tmp_path: Path, capsys: Any
) -> None:
    file = tmp_path / "result.json"
    file.write_text(json.dumps(spoiled(found.to_dict(), how)), encoding="utf-8")
    code = main(["export", str(folder), "--result", str(file), "--out", str(tmp_path / "out")])
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert code == 2 and line.startswith(f"flexviz: {file}") and says in line
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize(
    "name, content, says",
    [
        ("result.json", "{", "not valid JSON"),
        ("result.yaml", "a: [1, 2", "not valid YAML"),
        ("result.yaml", "a: b", 'holds no "parameters"'),
        ("result.json", "[" * 100_000, "not valid JSON"),
        ("result.txt", "{}", "expected .json or .yaml"),
        ("result.json", b"\xff\xfe", "cannot be read"),
    ],
)
def test_files_that_are_no_results(name: str, content: str | bytes, says: str, tmp_path: Path) -> None:
    file = tmp_path / name
    file.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(InputError) as caught:
        read_result(file)
    assert says in str(caught.value) and str(file) in str(caught.value)


def test_a_result_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"gone\.json: cannot be read"):
        read_result(tmp_path / "gone.json")


# -- the command ---------------------------------------------------------------------------------------------


def test_all_formats_at_once(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", "")  # nothing is compiled
    assert main(["export", str(folder), "--out", str(tmp_path / "new" / "out"), "--payload", "p2"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(":")[0].strip() for line in lines[1:]] == list(FORMATS)
    files = {file.name for file in (tmp_path / "new" / "out").iterdir()}
    assert files == {
        "arm.urdf", "arm.xml", "parameters.json", "parameters.yaml", "arm_dynamics.c", "arm_dynamics.h",
        "arm_dynamics.py", "friction.csv", "elasticity.csv",
    }  # fmt: skip
    assert list((tmp_path / "new").iterdir()) == [tmp_path / "new" / "out"]
    for file in (tmp_path / "new" / "out").iterdir():
        if file.suffix != ".h":
            assert "payload p2" in file.read_text(encoding="utf-8") or file.suffix == ".json"


def test_result_of_identify(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result = tmp_path / "result.json"
    assert main(["identify", str(folder), "--quick", "--json", str(result)]) == 0
    options = ["--result", str(result), "--to", "json", "--to", "yaml", "--to", "json"]
    assert main(["export", str(folder), "--out", str(tmp_path / "out"), *options]) == 0
    files = result, tmp_path / "out" / "parameters.json"
    given, written = (json.loads(file.read_text(encoding="utf-8")) for file in files)
    assert [p["value"] for p in written["parameters"]] == [p["value"] for p in given["parameters"]]
    assert {file.name for file in (tmp_path / "out").iterdir()} == {"parameters.json", "parameters.yaml"}
    capsys.readouterr()


def test_result_of_another_set_is_noted(
    folder: Path, found: Identification, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "result.json"
    file.write_text(json.dumps(found.to_dict() | {"set": "elsewhere"}), encoding="utf-8")
    command = ["export", str(folder), "--result", str(file), "--to", "json", "--out", str(tmp_path / "out")]
    assert main(command) == 0
    assert 'a result of the set "elsewhere", used for small' in capsys.readouterr().err


def test_not_converged(folder: Path, found: Identification, tmp_path: Path, capsys: Any) -> None:
    file = tmp_path / "result.json"
    file.write_text(json.dumps(found.to_dict() | {"converged": False}), encoding="utf-8")
    command = ["export", str(folder), "--result", str(file), "--to", "c", "--out", str(tmp_path / "out")]
    assert main(command) == 1
    assert "did not converge" in capsys.readouterr().err


@pytest.mark.parametrize(
    "options, says",
    [
        (["--to", "sdf"], 'format "sdf" does not exist; valid: urdf, mjcf, yaml, json, c, python'),
        (["--to", "URDF"], 'format "URDF" does not exist'),
        (["--payload", "p9"], 'payload "p9" does not exist; valid: p1, p2'),
        (["--result", "gone.json"], "gone.json: cannot be read"),
        (["--result", "gone.json", "--quick"], "--result: no identification is run"),
        (["--effect", "no_such"], 'effect "no_such" does not exist'),
        (["--out", "{full}"], "the folder is not empty, expected a new or empty folder"),
        (["--out", "{full}/there"], "this is a file, expected a new folder"),
        (["--out", "{full}/there/out"], "full/there: this is a file, expected a folder"),
    ],
)
def test_bad_usage(
    options: list[str], says: str, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    full = tmp_path / "full"
    full.mkdir()
    (full / "there").write_text("mine")
    options = [option.format(full=full) for option in options]
    out = [] if "--out" in options else ["--out", str(tmp_path / "out")]
    assert main(["export", str(folder), *options, *out]) == 2
    captured = capsys.readouterr()
    last = captured.err.strip().splitlines()[-1]
    assert last.startswith("flexviz: ") and says in last and captured.out == ""
    assert [file.name for file in tmp_path.iterdir()] == ["full"]
    assert (full / "there").read_text() == "mine" and len(list(full.iterdir())) == 1


def test_session(
    folder: Path, small: MeasurementSet, found: Identification, tmp_path: Path, capsys: Any
) -> None:
    """The present result with the diagnosis that belongs to it; without a result nothing is made up."""
    session = Session.of(small)
    place = tmp_path / "session"
    save_session(session, small, place)
    command = ["export", str(place), "--to", "json", "--out"]
    assert main([*command, str(tmp_path / "none")]) == 2
    assert "the session has no result, expected" in capsys.readouterr().err
    assert main([*command, str(tmp_path / "none"), "--quick"]) == 2
    assert "the saved result is exported" in capsys.readouterr().err
    analysis = session.analysis.with_effects(["torque_offset:joint2"])
    analysis = analysis.with_identification(found, analysis.settings).with_diagnosis(DIAGNOSIS)
    session = session.then("identified", analysis)
    save_session(session, small, place)
    assert main([*command, str(tmp_path / "out")]) == 0
    content = json.loads((tmp_path / "out" / "parameters.json").read_text(encoding="utf-8"))
    assert content["verdict"] == "missing" and content["remarks"] == []
    assert same(model_of(read_result(tmp_path / "out" / "parameters.json"), small.joints, "x"), found.model)
    capsys.readouterr()
    session = session.then("other observer", analysis.with_fit(observer="eso"))
    save_session(session, small, place)
    assert main([*command, str(tmp_path / "later")]) == 0
    assert "settings have been changed since these values were found" in capsys.readouterr().err


def test_nothing_is_left_of_a_failure(
    small: MeasurementSet, found: Identification, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(self: Path, content: bytes) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(InputError, match="No space left on device"):
        export(small, found, tmp_path / "out", ["json"])
    assert not list(tmp_path.iterdir())
