"""A measurement set written by hand: TOML text, URDF text and Parquet tables."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as parquet

from independent.arms import Arm, Array, Body, urdf_text
from independent.simulator import Record, Setup

GROUPS = ("g1", "g2", "g3", "g4")  # the last one is held out
TRAJECTORIES = ("t1", "t2", "t3", "t1")


def write(
    folder: Path,
    setup: Setup,
    record: Record,
    drawn: Arm,
    rough: tuple[Array, Array],
    own_effects: Sequence[str],
) -> None:
    """
    Args:
        folder: made if it is not there.
        setup: gives hold, payloads and names.
        record: with noise; its links' angles are not written.
        drawn: the arm as the URDF has it, wrong.
        rough: stiffness [Nm/rad] and motor inertia [kg m²] to begin with, each (n,).
        own_effects: what the set's model starts with.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "robot.urdf").write_text(urdf_text(drawn))
    lines = [
        "format = 1",
        'robot = "robot.urdf"',
        f"joints = [{_quoted(setup.arm.joints)}]",
        f"torque_hold = {setup.hold!r}",
        "",
        "[initial]",
        f"stiffness = {_list(rough[0])}",
        f"motor_inertia = {_list(rough[1])}",
        "",
        "[model]",
        f"effects = [{_quoted(own_effects)}]",
    ]
    link = setup.arm.links[-1].name
    for name, bodies in dict(zip(setup.payload_names, setup.payloads, strict=True)).items():
        lines += ["", f"[payloads.{name}]", f"bodies = [{', '.join(_body(link, b) for b in bodies)}]"]
    for i, (group, trajectory) in enumerate(zip(GROUPS, TRAJECTORIES, strict=True)):
        lines += ["", "[[groups]]", f'name = "{group}"', f'trajectory = "{trajectory}"']
        lines += [f'payload = "{setup.payload_names[i]}"', f'file = "{group}.parquet"']
        lines += ["validation = true"] if i + 1 == len(GROUPS) else []
        table = {"time": record.time}
        for j, joint in enumerate(setup.arm.joints):
            table |= {f"theta_{joint}": record.theta[i, :, j], f"tau_{joint}": record.tau[i, :, j]}
        parquet.write_table(pa.table(table), folder / f"{group}.parquet")
    (folder / "measurements.toml").write_text("\n".join([*lines, ""]))


def _quoted(names: Sequence[str]) -> str:
    return ", ".join(f'"{x}"' for x in names)


def _list(values: Array | Sequence[float]) -> str:
    return "[" + ", ".join(f"{float(x):.4g}" for x in values) + "]"


def _body(link: str, body: Body) -> str:
    com = [float(x) for x in body.com]
    inertia = [float(x) for x in body.inertia]
    return f'{{ link = "{link}", mass = {body.mass!r}, com = {com}, inertia = {inertia} }}'
