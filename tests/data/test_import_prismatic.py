"""Prismatic joints: m and N where others have rad and Nm."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import pytest
from small_set import LINK

from flexviz.base.errors import InputError
from flexviz.data.importing import Imported, import_logs, inspect_logs
from flexviz.robot._pinocchio import pin

LIFT = """<robot name="lift"><link name="base"/>{link1}{link2}
<joint name="lift" type="prismatic"><parent link="base"/><child link="link1"/><axis xyz="0 0 1"/>
    <limit lower="-0.2" upper="0.6" effort="300" velocity="2"/></joint>
<joint name="arm" type="revolute"><parent link="link1"/><child link="link2"/><axis xyz="0 -1 0"/>
    <limit lower="-3.1" upper="3.1" effort="200" velocity="10"/></joint></robot>"""
TIME = 0.002 * np.arange(2000)
MAPPING = """format = 1
robot = "lift.urdf"
[time]
column = "t"
[[logs]]
file = "run.csv"
group = "g1"
[joints.lift]
theta = {{ from = "x"{lift} }}
tau = {{ from = "f"{force} }}
{gear}
[joints.arm]
theta = {{ from = "p"{arm} }}
tau = "m"
"""


@pytest.fixture(autouse=True)
def no_delay(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("flexviz.data.importing.importing.torque_delay", lambda *_: None)


def motion() -> tuple[np.ndarray, np.ndarray]:
    """(N, 2) positions [m], [rad] and forces and torques [N], [Nm] of a lift that carries an arm."""
    size, w = np.array([0.15, 0.8]), np.array([2.7, 3.9])
    phase = np.outer(TIME, w)
    q, v, a = 0.2 + size * np.sin(phase), size * w * np.cos(phase), -size * w**2 * np.sin(phase)
    urdf = LIFT.format(link1=LINK.format(name="link1"), link2=LINK.format(name="link2"))
    model = pin.buildModelFromXML(urdf)
    data = model.createData()
    force = np.array([pin.rnea(model, data, *row) for row in zip(q, v, a, strict=True)]) + 2.0 * v
    noise = np.random.default_rng(0).normal(size=(2, *q.shape))  # of sensors: none would look filtered
    return q + 1e-6 * noise[0], force + 1e-3 * noise[1]


POSITION, FORCE = motion()


def imported(folder: Path, scale: float = 1.0, load: float = 1.0, **keys: Any) -> Imported:
    """What an import finds where the lift is recorded times `scale`, `load`; `keys` of the mapping."""
    links = {name: LINK.format(name=name) for name in ("link1", "link2")}
    (folder / "lift.urdf").write_text(LIFT.format(**links))
    columns = {"t": TIME, "x": scale * POSITION[:, 0], "f": load * FORCE[:, 0]}
    columns |= {"p": POSITION[:, 1], "m": FORCE[:, 1]}
    pacsv.write_csv(pa.table(columns), folder / "run.csv")
    keys = {"lift": "", "force": "", "arm": "", "gear": ""} | keys
    (folder / "mapping.toml").write_text(MAPPING.format(**keys))
    return import_logs(folder / "mapping.toml", None)


@pytest.mark.parametrize(
    "scale, force, keys",
    [
        (1.0, 1.0, {}),
        (1e3, 1e-3, {"lift": ', unit = "mm"', "force": ', unit = "kN"'}),
        (
            -400.0,
            -1 / 400,
            {"lift": ', side = "motor"', "force": ', side = "motor"', "gear": "gear = -400.0"},
        ),
    ],
)
def test_units_of_a_prismatic_joint(tmp_path: Path, scale: float, force: float, keys: dict[str, Any]) -> None:
    """m and N by default; before the gear, in rad of the motor per m, it is rad and Nm."""
    done = imported(tmp_path, scale, force, **keys)
    assert not done.issues
    np.testing.assert_allclose(done.groups[0].table.theta, POSITION, atol=1e-12)
    np.testing.assert_allclose(done.groups[0].table.tau, FORCE, atol=1e-9)


def test_millimetres_are_named(tmp_path: Path) -> None:
    """Degrees and other zeros are no remedies for a joint that slides."""
    (issue,) = imported(tmp_path, scale=1e3).issues
    assert issue.severity == "wrong" and issue.joints == ("lift",)
    assert [(fix.signal, fix.key, fix.value) for fix in issue.fixes] == [("theta", "unit", "mm")]


@pytest.mark.parametrize(
    "keys, expected",
    [
        ({"lift": ', unit = "deg"'}, r'lift\.theta\.unit: found "deg", but the joint is prismatic: .*m, mm'),
        ({"force": ', unit = "Nm"'}, r'lift\.tau\.unit: found "Nm", but the joint is prismatic: .*N, kN'),
        ({"arm": ', unit = "mm"'}, r'arm\.theta\.unit: found "mm", but the joint is revolute: .*rad'),
    ],
)
def test_a_unit_of_the_other_kind_is_refused(tmp_path: Path, keys: dict[str, Any], expected: str) -> None:
    with pytest.raises(InputError, match=expected):
        imported(tmp_path, **keys)


def test_inspection_states_the_units(tmp_path: Path) -> None:
    imported(tmp_path)
    columns = {"t": TIME, "lift_pos": 1e3 * POSITION[:, 0], "lift_torque": FORCE[:, 0]}
    columns |= {"arm_pos": POSITION[:, 1], "arm_torque": FORCE[:, 1]}
    pacsv.write_csv(pa.table(columns), tmp_path / "run.csv")
    inspection = inspect_logs([tmp_path / "run.csv"], str(tmp_path / "lift.urdf"))
    assert not inspection.issues
    assert inspection.draft.joints["lift"].signals["theta"] == {"from": "lift_pos", "unit": "mm"}
    assert inspection.draft.joints["lift"].signals["tau"] == {"from": "lift_torque", "unit": "N"}
