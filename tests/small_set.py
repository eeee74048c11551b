"""A small measurement set that tests may spoil: a planar arm whose torques fit its masses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import pyarrow.parquet as papq

from flexviz.robot._pinocchio import pin

LINK = """<link name="{name}"><inertial><origin xyz="0.25 0 0"/><mass value="4"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>
    <origin xyz="{x} 0 0"/><axis xyz="0 -1 0"/>
    <limit lower="-3.1" upper="3.1" effort="200" velocity="10"/></joint>"""
URDF = "\n".join(
    [
        '<robot name="arm"><link name="base"/>',
        LINK.format(name="link1"),
        LINK.format(name="link2"),
        JOINT.format(name="joint1", parent="base", child="link1", x=0),
        JOINT.format(name="joint2", parent="link1", child="link2", x=0.5),
        "</robot>",
    ]
)
TOML = """format = 1
robot = "robot.urdf"
joints = ["joint1", "joint2"]
torque_hold = 0.001

[initial]
stiffness = [2000, 1500.0]
motor_inertia = [1.5, 1.0]

[controller]
kp = [10000.0, 6000.0]
kd = [500.0, 250.0]

[model]
effects = ["coulomb_friction"]

[payloads.p1]
bodies = []
[payloads.p2]
bodies = [{ link = "link2", mass = 2.0, com = [0.3, 0.0, 0.0], inertia = [0.004, 0.004, 0.004, 0, 0, 0] }]

[[groups]]
name = "g1"
trajectory = "t1"
payload = "p1"
file = "a.csv"
[[groups]]
name = "g2"
trajectory = "t2"
payload = "p1"
file = "b.parquet"
[[groups]]
name = "g3"
trajectory = "t1"
payload = "p1"
file = "sub/c.csv"
validation = true
"""


def columns(seed: int = 0, rows: int = 2000, step: float = 0.002) -> dict[str, np.ndarray]:
    """Smooth motion of both joints with the torques the rigid arm needs, and a little noise."""
    rng = np.random.default_rng(seed)
    time = step * np.arange(rows)
    w = np.array([2.0, 3.1]) * (1 + 0.2 * seed)
    phase = np.outer(time, w)
    q = 0.6 * np.sin(phase)
    model = pin.buildModelFromXML(URDF)
    data = model.createData()
    state = zip(q, 0.6 * w * np.cos(phase), -0.6 * w**2 * np.sin(phase), strict=True)
    tau = np.array([pin.rnea(model, data, *row) for row in state]) + 0.6 * w * np.cos(phase)
    theta = q + tau / np.array([2000.0, 1500.0]) + 2e-5 * rng.normal(size=q.shape)
    tau = tau + 2e-3 * rng.normal(size=q.shape)
    table = {"time": time}
    for j in range(2):
        table |= {f"theta_joint{j + 1}": theta[:, j], f"tau_joint{j + 1}": tau[:, j]}
    table["q_joint1"] = q[:, 0]
    return table


def write_table(path: Path, table: dict[str, np.ndarray]) -> None:
    """CSV or Parquet, by the path's suffix."""
    path.parent.mkdir(exist_ok=True)
    if path.suffix == ".csv":
        pacsv.write_csv(pa.table(table), path, pacsv.WriteOptions(quoting_style="none"))
    else:
        papq.write_table(pa.table(table), path)


def write_small_set(folder: Path) -> Path:
    """The whole set in `folder`."""
    folder.mkdir(exist_ok=True)
    (folder / "robot.urdf").write_text(URDF)
    (folder / "measurements.toml").write_text(TOML)
    for seed, name in enumerate(("a.csv", "b.parquet", "sub/c.csv")):
        write_table(folder / name, columns(seed))
    return folder
