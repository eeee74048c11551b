"""Impossible values of a model are refused, whatever the export format; names cannot leave comments."""

from __future__ import annotations

import ast
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexviz.base.errors import InputError
from flexviz.data.measurements import MeasurementSet
from flexviz.outlets.exporting.code import c_code, python_code
from flexviz.robot.model import EffectValue
from tests.exporting_cases import identified, plan, short_set

GCC = shutil.which("gcc")


@pytest.fixture(scope="module")
def planar(tmp_path_factory: pytest.TempPathFactory) -> MeasurementSet:
    return short_set("planar-2r", tmp_path_factory.mktemp("planar"))


@pytest.mark.parametrize(
    "effect, values, says",
    [
        (
            "transmission_error",
            {"amplitude": 0.1, "order": 12.0, "phase": 0.0},
            "1.2, expected less than 1",
        ),
        (
            "stiffness_hardening",
            {"cubic_stiffness": -1.0},
            "cubic of joint1 is -1, expected zero or",
        ),
        (
            "presliding_hysteresis",
            {"presliding_stiffness": 1.0, "coulomb": 0.0},
            "expected positive numbers",
        ),
    ],
)
def test_values_that_make_no_robot_are_refused(
    effect: str, values: dict[str, float], says: str, planar: MeasurementSet
) -> None:
    model = replace(plan("planar-2r").model, effects=(EffectValue(effect, "joint1", values),))
    with pytest.raises(InputError, match=says):
        identified(planar, model)


def test_no_stiffness_no_robot(planar: MeasurementSet) -> None:
    model = replace(plan("planar-2r").model, stiffness=np.array([1000.0, 0.0]))
    with pytest.raises(InputError, match="stiffness of joint2 is 0 Nm/rad, expected a positive number"):
        identified(planar, model)


@pytest.mark.skipif(GCC is None, reason="gcc is not installed")
def test_names_of_joints_stay_in_comments(tmp_path: Path) -> None:
    measurements = short_set("planar-2r", tmp_path)
    names = ("*/ #error injected /*", 'j\nimport injected\n"""')
    model = replace(plan("planar-2r").model, joints=names)
    measurements = replace(measurements, joints=names, robot=replace(measurements.robot, joints=names))
    found = identified(measurements, model)
    code = {
        name: text for made in (c_code(found), python_code(found)) for name, text in made.contents.items()
    }
    for name, text in code.items():
        (tmp_path / name).write_bytes(text)
    for name, text in code.items():
        if name.endswith(".c"):
            subprocess.run([str(GCC), "-fsyntax-only", "-Werror", name], cwd=tmp_path, check=True)
        if name.endswith(".py"):
            imported = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Import)]
            assert [name.name for node in imported for name in node.names] == ["numpy"]
