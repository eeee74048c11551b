"""The built wheel, used in an empty folder far from the checkout."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

FINDS_ITS_DATA = """
from pathlib import Path
import flexviz
from flexviz.base.resources import robots_dir, sessions_dir
from flexviz.robot.robot import Robot
home = Path(flexviz.__file__).resolve().parent
assert home.is_relative_to(Path({site!r})), home
assert robots_dir() == home / "_data" / "robots", robots_dir()
assert any(sessions_dir().iterdir()), sessions_dir()
assert Robot.load("robots:planar_2r").n == 2
print("found")
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(folder)],
        cwd=ROOT,
        check=True,
        capture_output=True,
    )
    (path,) = folder.glob("flexviz-*.whl")
    return path


def files_under(folder: Path) -> set[str]:
    return {
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }


def test_wheel_holds_everything(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        metadata = archive.read(next(n for n in names if n.endswith(".dist-info/METADATA"))).decode()
    assert "flexviz/py.typed" in names
    assert any(name.endswith("licenses/LICENSE") for name in names)
    for folder in ("robots", "sessions"):
        shipped = {f"flexviz/_data/{folder}/{name}" for name in files_under(ROOT / folder)}
        assert shipped and shipped <= names
    assert not any(name.startswith(("tests/", "benchmarks/", "robots/", "sessions/")) for name in names)
    assert "License-Expression: Apache-2.0" in metadata


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The programs of a fresh environment with the wheel in it, installed without network.

    Its dependencies are those of the environment that runs the test, without this checkout.
    """
    home = tmp_path_factory.mktemp("environment")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(home)], check=True)
    programs = home / "bin"
    (site,) = home.glob("lib/python*/site-packages")
    purelib = sysconfig.get_paths()["purelib"]
    dependencies = [path for path in sys.path if path.startswith(purelib)]
    (site / "dependencies.pth").write_text("\n".join(dependencies))
    pip = [sys.executable, "-m", "pip", "--python", str(programs / "python"), "install", "--quiet"]
    subprocess.run([*pip, "--no-index", "--no-deps", str(wheel)], check=True)
    return programs


def run(installed: Path, folder: Path, *command: str) -> str:
    elsewhere = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    program = [installed / command[0], *command[1:]]
    done = subprocess.run(program, cwd=folder, capture_output=True, text=True, env=elsewhere)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_wheel_works_in_an_empty_folder(installed: Path, tmp_path: Path) -> None:
    site = str(installed.parent)
    assert run(installed, tmp_path, "python", "-c", FINDS_ITS_DATA.format(site=site)) == "found"
    assert run(installed, tmp_path, "flexviz", "--version") == "flexviz 0.1.0"
    (demo,) = installed.parent.glob("lib/python*/site-packages/flexviz/_data/sessions/planar-2r-demo")
    assert "stiffness" in run(installed, tmp_path, "flexviz", "identify", str(demo))
    assert not any(tmp_path.iterdir())
