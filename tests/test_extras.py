"""Without an extra: what needs it says in one line what to install, everything else works."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from itertools import chain
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from flexviz.base.errors import EXTRAS
from flexviz.checks.sets import COMPARING

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CONDA = {"pin": "pinocchio"}  # name of a package there
CORE_ONLY = (
    f"import sys; sys.modules.update(dict.fromkeys({[*EXTRAS, 'pandas']}))\n"  # None: cannot be imported
)


def in_the_core(program: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """A program in an environment without any extra."""
    command = [sys.executable, "-c", CORE_ONLY + program, *arguments]
    return subprocess.run(command, capture_output=True, text=True)


RUN = "from flexviz.outlets.terminal import main; sys.exit(main(sys.argv[1:]))"


@pytest.mark.parametrize(
    "arguments, says",
    [
        (["serve", "demo"], "the app needs viser, which is not installed: pip install 'flexviz[app]'"),
        (
            ["record", "demo", "--out", "x.rrd"],
            "a recording needs rerun, which is not installed: pip",
        ),
        (["review", "x.rrd"], "pip install 'flexviz[recording]'"),
        (["import", "x.mcap", "--robot", "robots:planar_2r"], "pip install 'flexviz[import]'"),
        (["study", "monte-carlo", "planar-2r", "--out", "x"], "pip install 'flexviz[batch]'"),
    ],
)
def test_a_command_names_its_extra(arguments: list[str], says: str, tmp_path: Path) -> None:
    (tmp_path / "x.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(99))
    inside = [str(tmp_path / word) if word.startswith("x") else word for word in arguments]
    done = in_the_core(RUN, *inside)
    assert done.returncode == 2 and done.stdout == ""
    *progress, said = done.stderr.strip().splitlines()
    assert all("%" in line or line == COMPARING.text for line in progress) and says in said, done.stderr


def test_analysis_report_and_export_need_no_extra(tmp_path: Path) -> None:
    program = f"""
import flexviz
measurements = flexviz.read_set("demo")
result = flexviz.identify(measurements, effects=["coulomb_friction:joint2"])
flexviz.export(measurements, result, {str(tmp_path / "robot")!r}, formats=["mjcf", "json"])
result.plot.law("coulomb_friction").save({str(tmp_path / "law.svg")!r})
import flexviz.outlets.workflows, flexviz.data.importing, flexviz.outlets.report
try:
    result.to_frame()
except ImportError as error:
    print(error)
"""
    done = in_the_core(program)
    assert done.returncode == 0, done.stderr
    assert "pip install 'pandas'" in done.stdout and (tmp_path / "law.svg").is_file()


def test_all_is_every_extra_and_each_module_is_in_the_one_that_is_named() -> None:
    extras = PROJECT["optional-dependencies"]
    (everything,) = extras["all"]
    assert Requirement(everything).extras == set(extras) - {"all"}
    for module, extra in EXTRAS.items():
        named = {Requirement(one).name.partition("-")[0] for one in extras[extra]}
        assert module in named


def test_the_conda_recipe_asks_for_the_same_versions() -> None:
    recipe = (ROOT / "docs" / "conda" / "recipe.yaml").read_text(encoding="utf-8")
    listed = dict(re.findall(r"^    - ([\w.-]+) ([<>=][^\s]*)", recipe, re.MULTILINE))
    wanted = chain(PROJECT["dependencies"], *PROJECT["optional-dependencies"].values())
    for one in map(Requirement, wanted):
        if one.name != "flexviz":
            assert Requirement(f"x{listed[CONDA.get(one.name, one.name)]}").specifier == one.specifier, one
    assert f"version: {PROJECT['version']}" in recipe
