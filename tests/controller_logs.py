"""Small logs in controllers' own forms, made of the independent simulator's runs."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
from mcap_ros2.writer import Writer

Array = np.ndarray

START = 1_700_000_000_000_000_000  # [ns] since 1970
GEARS, CONSTANTS = (101.0, 80.0), (0.12, 0.09)  # motor turns per joint turn, [Nm/A] of the motor
COUNT = 2 * np.pi / 4096  # [rad] of a servo's encoder
RATED = (0.64, 0.32)  # [Nm] of the motors


@dataclass(frozen=True)
class Run:
    """One run: time (N,) [s]; θ, τ, q, θ_ref and the joint torque (N, n) [rad], [Nm] at the joint."""

    time: Array
    theta: Array
    tau: Array
    q: Array
    reference: Array
    joint_torque: Array

    @property
    def current(self) -> Array:
        """(N, n) [A] of the motors."""
        return self.tau / np.array(GEARS) / np.array(CONSTANTS)

    @property
    def before_gear(self) -> Array:
        """(N, n) [Nm] of the motors."""
        return self.tau / np.array(GEARS)


def table(file: Path, columns: dict[str, Array], separator: str = ",", head: str = "") -> Path:
    """A text table."""
    values = np.column_stack([*columns.values()])
    rows = [separator.join(f"{x:.12g}" for x in row) for row in values]
    file.write_text("\n".join([f"{head}{separator.join(columns)}", *rows, ""]), encoding="utf-8")
    return file


def each(name: str, values: Array, first: int = 0) -> dict[str, Array]:
    """A column per joint; {} in the name is its number."""
    return {name.format(j + first): values[:, j] for j in range(values.shape[1])}


def rtde(folder: Path, run: Run) -> Path:
    columns = {"timestamp": 5321.5 + run.time, **each("target_q_{}", run.reference)}
    columns |= {**each("actual_q_{}", run.theta), **each("actual_qd_{}", np.gradient(run.theta, axis=0))}
    columns |= {**each("actual_current_{}", run.current), **each("target_moment_{}", 0.9 * run.tau)}
    return table(folder / "robot_data.csv", columns, " ")


def rtde_torque(folder: Path, run: Run) -> Path:
    columns = {"timestamp": run.time, **each("actual_q_{}", run.theta)}
    columns |= {**each("actual_current_{}", run.current), **each("actual_current_as_torque_{}", run.tau)}
    return table(folder / "robot_data.csv", columns)


def rsi(folder: Path, run: Run) -> Path:
    def frame(k: int) -> str:
        def part(tag: str, values: Array) -> str:
            row = [*values[k], *[0.0] * (6 - values.shape[1])]
            return f"<{tag} " + " ".join(f'A{j + 1}="{x:.9f}"' for j, x in enumerate(row)) + " />"

        degrees = part("AIPos", np.degrees(run.theta)) + part("ASPos", np.degrees(run.reference))
        more = '<RIst X="1.0" Y="2.0" Z="3.0" A="0" B="0" C="0" /><Delay D="0" />'
        time = f"<IPOC>{4208163634 + round(1e3 * run.time[k])}</IPOC>"
        return f'<Rob Type="KUKA">{more}{degrees}{part("MACur", run.current)}{time}</Rob>'

    file = folder / "rsi.xml"
    file.write_text("\n".join(frame(k) for k in range(len(run.time))), encoding="utf-8")
    return file


def egm_json(folder: Path, run: Run) -> Path:
    def message(k: int) -> dict[str, Any]:
        def joints(values: Array) -> dict[str, Any]:
            return {"joints": {"joints": [*np.degrees(values[k])]}}

        head = {"seqno": k, "tm": 900_000 + round(1e3 * run.time[k]), "mtype": "MSGTYPE_DATA"}
        signals = {"signals": [*run.before_gear[k]]}
        return {
            "header": head,
            "feedBack": joints(run.theta),
            "planned": joints(run.reference),
            "testSignals": signals,
        }

    return lines(folder / "egm.jsonl", [message(k) for k in range(len(run.time))])


def egm_logger(folder: Path, run: Run) -> Path:
    columns = {"TIMESTAMP": np.round(1e3 * run.time), **each("R_FB_POS_RJ{}", np.degrees(run.theta), 1)}
    columns |= {
        **each("S_REF_POS_RJ{}", np.degrees(run.reference), 1),
        **each("R_FB_TRQ_RJ{}", run.before_gear, 1),
    }
    return table(folder / "egm.csv", columns)


def twincat(folder: Path, run: Run) -> Path:
    """A Scope export with German numbers: tabs, decimal commas, per mille of the rated torque."""
    n = run.theta.shape[1]
    channels = {f"Axis {j + 1}.NcToPlc.ActPos": np.degrees(run.theta[:, j]) for j in range(n)}
    channels |= {f"Axis {j + 1}.NcToPlc.ActTorque": 1e3 * run.before_gear[:, j] / RATED[j] for j in range(n)}
    head = [
        "Name\tYT Project",
        "File\tscope.csv",
        "Starttime of export\t133\tMontag",
        "Endtime of export\t134",
        "",
        "",
    ]
    metadata = {
        "SymbolComment": "",
        "Data-Type": "REAL64",
        "SampleTime[ms]": "1",
        "VariableSize": "8",
        "Offset": "0",
    }
    head.append("\t".join(f"Name\t{name}" for name in channels))
    head += ["\t".join(f"{key}\t{value}" for _ in channels) for key, value in metadata.items()]
    head.append("\t".join(f"Unit\t{'deg (Angle)' if 'Pos' in name else '(None)'}" for name in channels))
    rows = [
        "\t".join(f"{1e3 * t:.10g}\t{x[k]:.12g}" for x in channels.values()) for k, t in enumerate(run.time)
    ]
    file = folder / "scope.csv"
    file.write_text("\n".join([*head, "", *(row.replace(".", ",") for row in rows), ""]), encoding="utf-8")
    return file


def libfranka(folder: Path, run: Run) -> Path:
    columns = {"time": np.round(1e3 * run.time), "success_rate": np.ones(len(run.time))}
    columns |= {**each("state.q[{}]", run.q), **each("state.q_d[{}]", run.reference)}
    columns |= {**each("state.tau_J[{}]", run.joint_torque), **each("cmd.tau_J_d[{}]", 0.3 * run.tau)}
    file = table(folder / "log.csv", columns)
    file.write_text(file.read_text().replace("],", "], ", 1), encoding="utf-8")  # as csvName writes it
    return file


def kinova(folder: Path, run: Run) -> Path:
    def message(k: int) -> dict[str, Any]:
        actuators = [
            {"position": p, "velocity": 0.1, "torque": t, "currentMotor": c}
            for p, t, c in zip(np.degrees(run.theta[k]), run.joint_torque[k], run.current[k], strict=True)
        ]
        return {"time": run.time[k], "actuators": actuators}

    return lines(folder / "feedback.jsonl", [message(k) for k in range(len(run.time))])


def unitree(folder: Path, run: Run) -> Path:
    def message(k: int) -> dict[str, Any]:
        motors = [
            {"mode": 1, "q": p, "dq": 0.1, "ddq": 0.0, "tau_est": t, "temperature": 31}
            for p, t in zip(run.theta[k], run.tau[k], strict=True)
        ]
        return {"tick": round(1e3 * run.time[k]), "motor_state": motors}

    return lines(folder / "lowstate.jsonl", [message(k) for k in range(len(run.time))])


def counts(run: Run, current: float, ids: str) -> dict[str, Array]:
    """Position and current of servos, not rounded: what is tested are names, scales and zeros."""
    columns = {"time": run.time}
    for j in range(run.theta.shape[1]):
        columns[f"present_position_{ids.format(j + 1)}"] = 2048 + run.theta[:, j] / COUNT
        columns[f"goal_position_{ids.format(j + 1)}"] = 2048 + run.reference[:, j] / COUNT
        columns[f"present_current_{ids.format(j + 1)}"] = run.current[:, j] / current
    return columns


def dynamixel(folder: Path, run: Run) -> Path:
    return table(folder / "dxl.csv", counts(run, 0.00269, "1{}"))


def feetech(folder: Path, run: Run) -> Path:
    columns = counts(run, 0.0065, "joint{}") | each("present_speed_joint{}", np.zeros_like(run.q), 1)
    return table(folder / "sts.csv", columns)


def lines(file: Path, messages: Sequence[dict[str, Any]]) -> Path:
    """One JSON record per line."""
    file.write_text("\n".join(map(json.dumps, messages)), encoding="utf-8")
    return file


# -- bags ----------------------------------------------------------------------------------------------------

SEPARATOR = "=" * 80
HEADER = (
    f"{SEPARATOR}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
    f"{SEPARATOR}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
)
JOINT_STATE = f"{SEPARATOR}\nMSG: sensor_msgs/JointState\nstd_msgs/Header header\nstring[] name\n" + "".join(
    f"float64[] {name}\n" for name in ("position", "velocity", "effort")
)
POINT = f"{SEPARATOR}\nMSG: trajectory_msgs/JointTrajectoryPoint\n" + "".join(
    f"float64[] {name}\n" for name in ("positions", "velocities", "accelerations", "effort")
)
POINT += "builtin_interfaces/Duration time_from_start\n"
DURATION = f"{SEPARATOR}\nMSG: builtin_interfaces/Duration\nint32 sec\nuint32 nanosec\n"
STATES = ("measured_joint_state", "desired_joint_state", "measured_joint_motor_state")
TYPES = {
    "franka_msgs/msg/FrankaRobotState": "std_msgs/Header header\n"
    + "".join(f"sensor_msgs/JointState {name}\n" for name in STATES)
    + f"float64[7] ddq_d\n{JOINT_STATE}{HEADER}",
    "control_msgs/msg/DynamicJointState": "std_msgs/Header header\nstring[] joint_names\n"
    f"control_msgs/InterfaceValue[] interface_values\n{SEPARATOR}\nMSG: control_msgs/InterfaceValue\n"
    f"string[] interface_names\nfloat64[] values\n{HEADER}",
    "control_msgs/msg/JointTrajectoryControllerState": "std_msgs/Header header\nstring[] joint_names\n"
    "trajectory_msgs/JointTrajectoryPoint reference\ntrajectory_msgs/JointTrajectoryPoint feedback\n"
    f"{POINT}{DURATION}{HEADER}",
    "unitree_go/msg/LowState": f"uint8[2] head\nMotorState[2] motor_state\nuint32 tick\n{SEPARATOR}\n"
    "MSG: unitree_go/MotorState\nuint8 mode\nfloat32 q\nfloat32 dq\nfloat32 tau_est\nuint32[2] reserve\n",
}
Message = Callable[[Run, int, dict[str, Any]], dict[str, Any]]


def bag(folder: Path, run: Run, topics: dict[str, tuple[str, Message]]) -> Path:
    """An MCAP file; each topic has a type and a function that makes its message k with a header."""
    file = folder / "run.mcap"
    with file.open("wb") as stream:
        writer = Writer(stream)
        schemas = {kind: writer.register_msgdef(kind, TYPES[kind]) for kind, _ in topics.values()}
        for k, t in enumerate(run.time):
            at = START + round(1e9 * t)
            header = {"stamp": {"sec": at // 10**9, "nanosec": at % 10**9}, "frame_id": ""}
            for topic, (kind, message) in topics.items():
                content = message(run, k, header)
                writer.write_message(topic, schemas[kind], content, log_time=at, publish_time=at)
        writer.finish()
    return file


def joint_names(run: Run) -> list[str]:
    return [f"joint{j + 1}" for j in range(run.theta.shape[1])]


def franka_bag(folder: Path, run: Run) -> Path:
    def message(run: Run, k: int, header: dict[str, Any]) -> dict[str, Any]:
        def state(position: Array, effort: Array | None = None) -> dict[str, Any]:
            more = {"velocity": [0.0] * 2, "effort": [] if effort is None else [*effort[k]]}
            return {"header": header, "name": joint_names(run), "position": [*position[k]], **more}

        return {
            "header": header,
            "measured_joint_state": state(run.q, run.joint_torque),
            "desired_joint_state": state(run.reference, 0.3 * run.tau),
            "measured_joint_motor_state": state(run.theta),
            "ddq_d": [0.0] * 7,
        }

    return bag(folder, run, {"/franka/robot_state": ("franka_msgs/msg/FrankaRobotState", message)})


def ros2_control_bag(folder: Path, run: Run) -> Path:
    """What ros2_control publishes: states with any interfaces, and the trajectory controller's reference."""

    def dynamic(run: Run, k: int, header: dict[str, Any]) -> dict[str, Any]:
        values = [
            {"interface_names": ["position", "effort"], "values": [p, t]}
            for p, t in zip(run.theta[k], run.tau[k], strict=True)
        ]
        return {"header": header, "joint_names": joint_names(run), "interface_values": values}

    def controller(run: Run, k: int, header: dict[str, Any]) -> dict[str, Any]:
        empty = {"velocities": [], "accelerations": [], "effort": []}
        empty |= {"time_from_start": {"sec": 0, "nanosec": 0}}
        return {
            "header": header,
            "joint_names": joint_names(run),
            "reference": {"positions": [*run.reference[k]], **empty},
            "feedback": {"positions": [], **empty},
        }

    types = "control_msgs/msg/DynamicJointState", "control_msgs/msg/JointTrajectoryControllerState"
    topics = ("/dynamic_joint_states", dynamic), ("/arm_controller/controller_state", controller)
    return bag(folder, run, {topic: (kind, made) for kind, (topic, made) in zip(types, topics, strict=True)})


def unitree_bag(folder: Path, run: Run) -> Path:
    def message(run: Run, k: int, header: dict[str, Any]) -> dict[str, Any]:
        motors = [
            {"mode": 1, "q": p, "dq": 0.0, "tau_est": t, "reserve": [0, 0]}
            for p, t in zip(run.theta[k], run.tau[k], strict=True)
        ]
        return {"head": [254, 239], "motor_state": motors, "tick": round(1e3 * run.time[k])}

    return bag(folder, run, {"/lowstate": ("unitree_go/msg/LowState", message)})


# -- containers ----------------------------------------------------------------------------------------------


def excel(file: Path, columns: dict[str, Array]) -> Path:
    """A workbook with shared strings, as spreadsheet programs write it."""
    space = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'
    letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
    names = "".join(f'<c r="{letters[j]}1" t="s"><v>{j}</v></c>' for j in range(len(columns)))
    rows = [f'<row r="1">{names}</row>']
    for i, row in enumerate(np.column_stack([*columns.values()]), 2):
        cells = "".join(f'<c r="{letters[j]}{i}"><v>{x:.12g}</v></c>' for j, x in enumerate(row))
        rows.append(f'<row r="{i}">{cells}</row>')
    texts = "".join(f"<si><t>{escape(name)}</t></si>" for name in columns)
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as book:
        book.writestr("xl/sharedStrings.xml", f"<sst {space}>{texts}</sst>")
        book.writestr(
            "xl/worksheets/sheet1.xml",
            f"<worksheet {space}><sheetData>{''.join(rows)}</sheetData></worksheet>",
        )
        book.writestr("xl/worksheets/sheet2.xml", f"<worksheet {space}><sheetData/></worksheet>")
    return file
