"""C and Python code of the inverse dynamics, for feed-forward control.

The code is the same for every robot (`template.c`, `template.py`): recursive Newton–Euler on quantities with
their first and second derivative, the joint's law solved for its deflection, and the motor's equation. A
robot's numbers stand before it, and what a robot does not have is left out.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flexviz.exporting.sections import with_sections
from flexviz.exporting.subject import Subject, left_out
from flexviz.exporting.values import INTEGERS, Numbers, numbers

_HERE = Path(__file__).parent
WIDTH = 100
ASCII = {"θ": "theta", "τ": "tau", "²": "^2", "³": "^3", "₃": "3", "·": "*", "σ": "sigma", "–": "-", "−": "-"}
EXPLAINED = (
    "",
    "    link    M(q) ddq + c(q, dq) + g(q) + f_l = tau_joint",
    "    motor   B ddtheta + f_m + tau_joint = tau",
    "    joint   tau_joint = K (theta - q)",
    "",
    "Inputs are the desired positions q of the LINKS with their first four derivatives: the motor's",
    "acceleration contains the second derivative of the joint's torque, and that the fourth of q. The",
    "reference has to be four times differentiable, as a polynomial of degree nine between points at rest.",
    "Give tau to the drives as feed-forward and theta, theta_velocity to the controller of the motors.",
)
TREATED = {
    "half_width": "Backlash: theta jumps by the play where the load changes sides; the velocity and torque "
    "that would take are left to the controller.",
    "damping": "Joint damping: the deflection is a series in D/K up to its second power; what the motor's "
    "acceleration leaves out is (D/K) times the third derivative of the deflection.",
    "link_coulomb": "Dry friction of the link: in tau and theta, not in their derivatives, which would jump.",
    "presliding": "Presliding friction remembers: give one memory at every cycle, from a start at rest; "
    "without one its sliding friction acts at once.",
    "drift": "Friction of a cold gear: `time` is that since the run began; at infinity the gear is warm.",
    "delay": "Torque delay: evaluate the motion at time + delay of each joint; it is not applied here.",
}


def c_code(subject: Subject) -> tuple[dict[str, bytes], list[str]]:
    """Header and source by file name, and what they do not hold."""
    found, missing = numbers(subject), left_out(subject, "c")
    name = subject.name
    arrays = [_c_array(key, *value) for key, value in found.arrays.items() if key != "TORQUE_DELAY"]
    rows = [_c_rows(key, *value) for key, value in found.rows.items()]
    template = (_HERE / "template.c").read_text(encoding="utf-8")
    top, code = template.split("/* code: */\n")
    top = top[top.index("#include") :]
    delay = _c_array("TORQUE_DELAY", *found.arrays["TORQUE_DELAY"])
    seen = "const double NAME_torque_delay[NAME_JOINTS]"
    delay = delay.replace("static const double TORQUE_DELAY[N]", seen)
    comment = _comment([*_about(subject, found), *_missing_lines(missing)])
    source = "\n".join((comment, top, *arrays, *rows, delay, with_sections(code, found.sections)))
    header = (_HERE / "template.h").read_text(encoding="utf-8")
    listed = ", ".join(f"{i} {_ascii(joint)}" for i, joint in enumerate(subject.joints))
    header = header.replace("JOINT_NAMES", listed).replace("JOINT_COUNT", str(subject.robot.n))
    header = header.replace("GUARD", "UPPER_DYNAMICS_H")
    header = _comment([*subject.heading[:2], f"See {name}_dynamics.c."]) + "\n" + header
    files = {f"{name}_dynamics.h": header, f"{name}_dynamics.c": source}
    return {key: _named(text, name).encode() for key, text in files.items()}, missing


def python_code(subject: Subject) -> tuple[dict[str, bytes], list[str]]:
    """The module by its file name, and what it does not hold."""
    found, missing = numbers(subject), left_out(subject, "python")
    template = (_HERE / "template.py").read_text(encoding="utf-8")
    code = with_sections(template.split("# code:\n")[1], found.sections)
    about = "\n".join(_wrapped([*_about(subject, found), *_missing_lines(missing)])).replace("\\", "\\\\")
    parts = [
        f'"""{about.replace(chr(34), chr(39))}\n"""',
        "from __future__ import annotations\n\nfrom typing import NamedTuple\n\nimport numpy as np\n",
        f"JOINTS = {subject.joints!r}",
        *(_python_array(key, *value) for key, value in found.arrays.items()),
        *(_python_rows(key, *value) for key, value in found.rows.items()),
    ]
    return {f"{subject.name}_dynamics.py": ("\n".join(parts) + "\n" + code).encode()}, missing


def _about(subject: Subject, found: Numbers) -> list[str]:
    lines = ["Inverse dynamics for feed-forward control.", *subject.heading, *EXPLAINED, ""]
    lines += [text for name, text in TREATED.items() if name in found.sections]
    if subject.laws["delay"].any():
        lines.append(TREATED["delay"])
    return [*lines, "SPDX-License-Identifier: Apache-2.0"]


def _missing_lines(missing: Sequence[str]) -> list[str]:
    return [f"NOT CONTAINED: {text}" for text in missing]


# -- C -------------------------------------------------------------------------------------------------------


def _c_array(name: str, values: Any, meaning: str) -> str:
    values = np.asarray(values)
    kind = "int" if values.dtype.kind == "i" else "double"
    first = "[3]" if name == "GRAVITY" else "[N]"  # everything else has one entry a joint or body
    size = "".join(first if k == 0 else f"[{length}]" for k, length in enumerate(values.shape))
    comment = f"/* {_ascii(meaning)} */\n" if meaning else ""
    return f"{comment}static const {kind} {name}{size} = {_braces(values.tolist())};"


def _c_rows(name: str, rows: list[tuple[float, ...]], columns: tuple[str, ...], meaning: str) -> str:
    integers = [c for c in columns if c in INTEGERS]
    others = [c for c in columns if c not in INTEGERS]
    entries = ", ".join(_braces(_typed(row, columns)) for row in rows)
    return (
        f"/* {_ascii(meaning)} */\n"
        f"static const struct {{ int {', '.join(integers)}; double {', '.join(others)}; }} {name}[] = "
        f"{{{entries}}};"
    )


def _braces(value: Any, indent: int = 4) -> str:
    if not isinstance(value, list | tuple):
        return repr(value)
    if value and isinstance(value[0], list):
        inside = f",\n{' ' * indent}".join(_braces(item, indent + 4) for item in value)
        return f"{{\n{' ' * indent}{inside}}}"
    return "{" + ", ".join(_braces(item) for item in value) + "}"


def _comment(lines: Iterable[str]) -> str:
    wrapped = _wrapped([_ascii(line).replace("*/", "* /").replace("/*", "/ *") for line in lines])
    return "\n".join(["/*", *(f" * {line}".rstrip() for line in wrapped), " */"])


def _named(text: str, name: str) -> str:
    text = re.sub(r"\bNAME_JOINTS\b|\bUPPER_JOINTS\b", f"{name.upper()}_JOINTS", text)
    text = text.replace("UPPER_DYNAMICS_H", f"{name.upper()}_DYNAMICS_H")
    return re.sub(r"\bNAME_", f"{name}_", text)


# -- Python --------------------------------------------------------------------------------------------------


def _python_array(name: str, values: Any, meaning: str) -> str:
    values = np.asarray(values)
    comment = f"# {_ascii(meaning)}\n" if meaning else ""
    if values.ndim == 0:
        return f"{comment}{name} = {values.item()!r}"
    if values.dtype.kind == "i":
        return f"{comment}{name} = {tuple(values.tolist())!r}"
    return f"{comment}{name} = np.array({_brackets(values.tolist())})"


def _brackets(value: Any, indent: int = 4) -> str:
    if value and isinstance(value[0], list):
        inside = "".join(f"{' ' * indent}{_brackets(item, indent + 4)},\n" for item in value)
        return f"[\n{inside}{' ' * (indent - 4)}]"
    return repr(value)


def _python_rows(name: str, rows: list[tuple[float, ...]], columns: tuple[str, ...], meaning: str) -> str:
    inside = "".join(f"    {_typed(row, columns)!r},\n" for row in rows)
    return f"# {_ascii(meaning)}: ({', '.join(columns)})\n{name} = (\n{inside})"


def _typed(row: tuple[float, ...], columns: tuple[str, ...]) -> tuple[float | int, ...]:
    return tuple(int(v) if c in INTEGERS else float(v) for v, c in zip(row, columns, strict=True))


# -- both ----------------------------------------------------------------------------------------------------


def _ascii(text: str) -> str:
    """For compilers and editors of every kind."""
    for character, instead in ASCII.items():
        text = text.replace(character, instead)
    return text.encode("ascii", "replace").decode()


def _wrapped(lines: Iterable[str]) -> list[str]:
    import textwrap

    out: list[str] = []
    for line in lines:
        out += [line] if line.startswith(" ") else textwrap.wrap(line, WIDTH) or [""]
    return out
