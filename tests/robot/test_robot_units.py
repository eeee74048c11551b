"""A robot description in mm, g or kg mm² is named as such, by what it would be in SI units."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from flexviz import Robot
from flexviz.base.errors import InputError
from flexviz.outlets.app.uploads import describe_robot
from flexviz.outlets.terminal import main
from flexviz.robot.robot_files import example_robots, robots_dir
from flexviz.robot.urdf_units import Units
from tests.shared_data import FAULTS, REAL
from tests.small_set import URDF, write_small_set

CASES = {  # units: words of the message
    Units("mm"): (
        "reaches 750 m, of 8 kg: lengths in mm? 0.75 m and 8 kg",
        "by 1,000; leave every mass and every inertia",
    ),
    Units("cm"): ("lengths in cm?", "Divide every length (xyz of each origin", "by 100;"),
    Units("mm", inertia=("kg", "mm")): ("lengths in mm, inertias in kg mm²?", "every inertia by 1,000,000"),
    Units("m", "g", ("g", "m")): (
        "reaches 0.75 m, of 8,000 kg: masses in g, inertias in g m²?",
        "Divide every mass and every inertia by 1,000; leave every length",
    ),
    Units("m", "g"): ("masses in g? 0.75 m and 8 kg are plausible", "leave every length and every inertia"),
    Units("mm", "g", ("g", "mm")): ("lengths in mm, masses in g, inertias in g mm²?",),
    Units("mm", "t", ("t", "mm")): ("masses in t", "multiply every mass by 1,000"),
    Units(inertia=("kg", "mm")): ("with radii of gyration of 158 m: inertias in kg mm²?",),
    Units(inertia=("g", "mm")): ("inertias in g mm²?", "leave every length and every mass"),
    Units(inertia=("kg", "cm")): ("inertias in kg cm²?", "Divide every inertia by 10,000"),
}  # fmt: skip


def in_units(text: str, units: Units) -> str:
    """A description in SI units, written in others."""
    length, mass, inertia = units.scales

    def times(scale: float, found: re.Match[str]) -> str:
        return found[1] + " ".join(f"{scale * float(word):.12g}" for word in found[2].split()) + '"'

    text = re.sub(r'(<origin xyz=")([^"]*)"', lambda found: times(length, found), text)
    text = re.sub(r'(<mass value=")([^"]*)"', lambda found: times(mass, found), text)
    return re.sub(r'( i[xyz]{2}=")([^"]*)"', lambda found: times(inertia, found), text)


@pytest.mark.parametrize("units", CASES, ids=lambda units: " ".join(units.names))
def test_other_units_are_named_with_their_remedy(units: Units, tmp_path: Path) -> None:
    file = tmp_path / "arm.urdf"
    file.write_text(in_units(URDF, units), encoding="utf-8")
    with pytest.raises(InputError) as error:
        Robot.load(file)
    assert all(word in str(error.value) for word in ("arm.urdf", *CASES[units])), str(error.value)
    with pytest.raises(InputError, match=r"^arm\.urdf.* in "):  # in the app
        describe_robot(file)


@pytest.mark.parametrize("command", ["identify", "diagnose", "verify", "simulate"])
def test_the_description_is_blamed_and_not_the_data(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = write_small_set(tmp_path)
    robot = folder / "robot.urdf"
    robot.write_text(in_units(robot.read_text(), Units("mm")), encoding="utf-8")
    (tmp_path / "limits.toml").write_text("[default]\nheld_out_percent = 50.0\n")
    more = {
        "verify": ["--require", str(tmp_path / "limits.toml")],
        "simulate": ["--out", str(tmp_path / "x")],
    }
    source = robot if command == "simulate" else folder
    assert main([command, str(source), *more.get(command, [])]) == 2
    said = capsys.readouterr().err
    assert "robot.urdf: the description is of a robot that reaches 750 m" in said and "kNm" not in said


def test_real_robots_are_silent() -> None:
    files = [*example_robots().values(), *robots_dir().glob("*/*.urdf"), *REAL.glob("**/*.urdf")]
    spoke = []
    for file in files:
        try:
            Robot.load(file)
        except InputError as error:
            spoke += [file.stem] if "are plausible" in str(error) else []
    assert len(files) > 2 and not spoke


@pytest.mark.parametrize(("name", "word"), [("mm", "lengths in mm?"), ("grams", "masses in g"), ("ok", "")])
def test_given_descriptions(name: str, word: str) -> None:
    file = FAULTS / "23-urdf-in-mm-or-grams" / f"{name}.urdf"
    if not file.exists():
        pytest.skip("the inputs are not here")
    if not word:
        assert Robot.load(file).notes == ()
        return
    with pytest.raises(InputError, match=word.replace("?", r"\?")):
        Robot.load(file)
