"""A robot description that cannot be meant is refused in one line, before a library drops a part of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from flexviz.base.errors import InputError
from flexviz.data.measurements import read_set
from flexviz.robot.robot import Robot
from tests.small_set import JOINT, LINK, URDF, write_small_set

VISUAL = "<visual><geometry>{}</geometry></visual></link>"
AXIS = '<axis xyz="0 -1 0"/>'
MASS = '<mass value="4"/>'
CHILD = '<child link="link2"/>'

# what is wrong: (old text, new text, words of the message)
BAD: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "comma in a mass": (MASS, '<mass value="3,75"/>', ('link "link1", mass value', '"3,75"', "a number")),
    "text for a mass": (MASS, '<mass value="abc"/>', ('"abc"', "a number")),
    "empty mass": (MASS, "<mass/>", ("link1", "<mass> has no value")),
    "no mass": (MASS, "", ("link1", "<inertial> has no <mass>")),
    "negative mass": (MASS, '<mass value="-3"/>', ('"-3"', "0 to 1e+06")),
    "huge mass": (MASS, '<mass value="1e300"/>', ('"1e300"', "0 to 1e+06")),
    "nan mass": (MASS, '<mass value="nan"/>', ('"nan"', "a number")),
    "underscore": (MASS, '<mass value="1_0"/>', ('"1_0"', "a number")),
    "no moment": ('ixx="0.1"', "", ("link1", "<inertia> has no ixx")),
    "text for a moment": ('izz="0.1"', 'izz="x"', ("inertia izz", '"x"')),
    "impossible moments": ('izz="0.1"', 'izz="-0.1"', ("no body", '"joint1"', "-0.1", "4 kg")),
    "axis of zeros": (AXIS, '<axis xyz="0 0 0"/>', ('joint "joint1", axis xyz', '"0 0 0"', "a direction")),
    "axis of two": (AXIS, '<axis xyz="0 1"/>', ("axis xyz", '"0 1"', "3 numbers")),
    "far origin": (
        '<origin xyz="0.25 0 0"/>',
        '<origin xyz="1e200 0 0"/>',
        ("origin xyz", "-10000 to 10000"),
    ),
    "text in a limit": ('lower="-3.1"', 'lower="-π"', ('joint "joint1", limit lower', '"-π"')),
    "visual": ("</link>", VISUAL.format('<sphere radius="abc"/>'), ("sphere radius", '"abc"')),
    "box": ("</link>", VISUAL.format('<box size="1 1"/>'), ("box size", "3 numbers")),
    "mesh": ("</link>", VISUAL.format("<mesh/>"), ("<mesh> has no filename",)),
    "unknown type": ('type="revolute"', 'type="hinge"', ('joint "joint1", type', '"hinge"', "revolute")),
    "unknown link": (CHILD, '<child link="hand"/>', ('joint "joint2", child', '"hand" does not exist')),
    "cycle": ('<parent link="base"/>', '<parent link="link2"/>', ("3 links and 2 joints form no tree",)),
    "two parents": (CHILD, '<child link="link1"/>', ("form no tree",)),
    "name twice": ('name="link2"', 'name="link1"', ('two links are called "link1"',)),
    "no name": ('<joint name="joint2"', "<joint", ("a <joint> has no name",)),
}


@pytest.mark.parametrize("what", BAD)
def test_one_line_names_what_is_wrong(what: str, tmp_path: Path) -> None:
    old, new, words = BAD[what]
    folder = write_small_set(tmp_path)
    assert old in URDF
    (folder / "robot.urdf").write_text(URDF.replace(old, new, 1))
    with pytest.raises(InputError) as error:
        read_set(folder)
    assert all(word in str(error.value) for word in ("robot.urdf", *words)), str(error.value)


def chain(joints: int) -> str:
    """A chain of this many revolute joints."""
    parts = ['<robot name="chain"><link name="link0"/>']
    for i in range(1, joints + 1):
        ends = {"parent": f"link{i - 1}", "child": f"link{i}"}
        parts += [LINK.format(name=f"link{i}"), JOINT.format(name=f"joint{i}", x=0.1, **ends)]
    return "".join(parts) + "</robot>"


@pytest.mark.parametrize(
    ("joints", "words"), [(4000, "4001 links, expected at most 1000"), (200, "at most 128")]
)
def test_long_chains_are_refused(joints: int, words: str, tmp_path: Path) -> None:
    file = tmp_path / "chain.urdf"
    file.write_text(chain(joints))
    with pytest.raises(InputError, match=words):
        Robot.load(file)
    if joints == 200:
        assert Robot.load(file, ["joint1", "joint200"]).n == 2


def test_large_and_deep_files_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "deep.urdf"
    file.write_text("<robot><link name='base'/>" + "<a>" * 100_000 + "</a>" * 100_000 + "</robot>")
    with pytest.raises(InputError, match="nested too deeply"):
        Robot.load(file)
    with file.open("wb") as stream:
        stream.truncate(2**30)
    with pytest.raises(InputError, match="larger than"):
        Robot.load(file)
