"""C and Python code of the inverse dynamics, for feed-forward control.

`template.c` and `template.py` are the same for every robot: recursive Newton–Euler on quantities with
their first and second derivatives, the joint law solved for the deflection, and the motor equation. The
robot's parameters precede the code; template sections of unused effects are removed.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any

from flexviz.base.errors import InputError
from flexviz.content.wording import sliding_note
from flexviz.outlets.exporting.code_tables import INDICES, CodeArray, CodeRows, CodeTables, code_tables
from flexviz.outlets.exporting.identified import FormatFiles, IdentifiedRobot

_HERE = Path(__file__).parent
# a comment that opens, "[name", or closes, "name]", a template section
MARK = re.compile(r"\s*(?:#|/\*)\s*(?:\[(?P<open>\w+)|(?P<close>\w+)\])\s*(?:\*/)?\s*")
LINE_LENGTH = 100
ASCII = {"θ": "theta", "τ": "tau", "²": "^2", "³": "^3", "₃": "3", "·": "*", "σ": "sigma", "–": "-", "−": "-"}
EQUATIONS = (
    "",
    "    link    M(q) ddq + c(q, dq) + g(q) + f_l = tau_joint",
    "    motor   B ddtheta + f_m + tau_joint = tau",
    "    joint   tau_joint = K (theta - q)",
    "",
    "Inputs are the desired positions q of the LINKS with their first four derivatives: the motor's",
    "acceleration contains the second derivative of the joint's torque, hence the fourth of q. The",
    "reference must be four times differentiable, e.g. a polynomial of degree nine between poses at rest.",
    "Give tau to the drives as feed-forward and theta, theta_velocity to the motor controllers.",
    "",
)
NOTES = {
    "half_width": "Backlash: theta jumps by the play where the load changes sign; the velocity and torque "
    "of that jump are left to the controller.",
    "damping": "Joint damping: the deflection is a series in D/K up to the second power; the motor's "
    "acceleration neglects (D/K) times the third derivative of the deflection.",
    "link_coulomb": "Dry friction of the link: in tau and theta, but not in their derivatives, which jump.",
    "presliding": "Presliding friction has a state: pass the same memory at every cycle, starting at rest; "
    "without a memory, the sliding friction acts immediately.",
    "drift": "Friction of a cold gear: `time` is the time since the run began; infinity means a warm gear.",
}
DELAYED = "Torque delay: evaluate the motion at time + delay of each joint; it is not applied here."


def c_code(identified: IdentifiedRobot) -> FormatFiles:
    """Header and source."""
    tables, missing, name = code_tables(identified), identified.left_out("c"), identified.name
    arrays = {key: _c_array(key, array) for key, array in tables.arrays.items()}
    exported = "const double NAME_torque_delay[NAME_JOINTS]"
    delay = arrays.pop("TORQUE_DELAY").replace("static const double TORQUE_DELAY[N]", exported)
    rows = [_c_rows(key, rows) for key, rows in tables.rows.items()]
    top, code = _template("template.c", "/* code: */\n", tables)
    top = top[top.index("#include") :]
    comment = _comment(_about(identified, tables, missing))
    source = "\n".join((comment, top, *arrays.values(), *rows, delay, code))
    header = (_HERE / "template.h").read_text(encoding="utf-8")
    listed = ", ".join(f"{i} {_ascii(joint)}" for i, joint in enumerate(identified.joints))
    header = header.replace("JOINT_NAMES", listed).replace("JOINT_COUNT", str(identified.robot.n))
    header = header.replace("GUARD", "UPPER_DYNAMICS_H")
    units = filter(None, [sliding_note(identified.joints, identified.robot.prismatic)])
    header = _comment([*identified.heading[:2], *units, f"See {name}_dynamics.c."]) + "\n" + header
    files = {f"{name}_dynamics.h": header, f"{name}_dynamics.c": source}
    return FormatFiles({key: _named(text, name).encode() for key, text in files.items()}, missing)


def python_code(identified: IdentifiedRobot) -> FormatFiles:
    """One module."""
    tables, missing = code_tables(identified), identified.left_out("python")
    _, code = _template("template.py", "# code:\n", tables)
    about = "\n".join(_wrapped(_about(identified, tables, missing)))
    about = about.replace("\\", "\\\\").replace('"', "'")
    parts = [
        f'"""{about}\n"""',
        "from __future__ import annotations\n\nfrom typing import NamedTuple\n\nimport numpy as np\n",
        f"JOINTS = {identified.joints!r}",
        *(_python_array(key, array) for key, array in tables.arrays.items()),
        *(_python_rows(key, rows) for key, rows in tables.rows.items()),
    ]
    module = "\n".join(parts) + "\n" + code
    return FormatFiles({f"{identified.name}_dynamics.py": module.encode()}, missing)


def _about(identified: IdentifiedRobot, tables: CodeTables, missing: list[str]) -> list[str]:
    lines = ["Inverse dynamics for feed-forward control.", *identified.heading, *EQUATIONS]
    lines += [text for name, text in NOTES.items() if name in tables.sections]
    if identified.laws["torque_delay"].any():
        lines.append(DELAYED)
    return [*lines, "SPDX-License-Identifier: Apache-2.0", *(f"NOT CONTAINED: {text}" for text in missing)]


# -- C -------------------------------------------------------------------------------------------------------


def _c_array(name: str, array: CodeArray) -> str:
    kind = "int" if array.values.dtype.kind == "i" else "double"
    first = "[3]" if name == "GRAVITY" else "[N]"  # all others have one entry per joint or body
    size = "".join(first if k == 0 else f"[{length}]" for k, length in enumerate(array.values.shape))
    comment = f"/* {_ascii(array.meaning)} */\n" if array.meaning else ""
    return f"{comment}static const {kind} {name}{size} = {_nested(array.values.tolist(), '{}')};"


def _c_rows(name: str, table: CodeRows) -> str:
    integers = ", ".join(c for c in table.columns if c in INDICES)
    others = ", ".join(c for c in table.columns if c not in INDICES)
    entries = ", ".join(_nested(row, "{}") for row in table.rows)
    struct = f"static const struct {{ int {integers}; double {others}; }}"
    return f"/* {_ascii(table.meaning)} */\n{struct} {name}[] = {{{entries}}};"


def _comment(lines: Iterable[str]) -> str:
    wrapped = _wrapped([_ascii(line) for line in lines])
    return "\n".join(["/*", *(f" * {line}".rstrip() for line in wrapped), " */"])


def _named(text: str, name: str) -> str:
    text = re.sub(r"\bNAME_JOINTS\b|\bUPPER_JOINTS\b", f"{name.upper()}_JOINTS", text)
    text = text.replace("UPPER_DYNAMICS_H", f"{name.upper()}_DYNAMICS_H")
    return re.sub(r"\bNAME_", f"{name}_", text)


# -- Python --------------------------------------------------------------------------------------------------


def _python_array(name: str, array: CodeArray) -> str:
    values = array.values
    comment = f"# {_ascii(array.meaning)}\n" if array.meaning else ""
    if values.ndim == 0:
        return f"{comment}{name} = {values.item()!r}"
    if values.dtype.kind == "i":
        return f"{comment}{name} = {tuple(values.tolist())!r}"
    return f"{comment}{name} = np.array({_nested(values.tolist(), '[]')})"


def _python_rows(name: str, table: CodeRows) -> str:
    inside = "".join(f"    {row!r},\n" for row in table.rows)
    return f"# {_ascii(table.meaning)}: ({', '.join(table.columns)})\n{name} = (\n{inside})"


# -- both ----------------------------------------------------------------------------------------------------


def _nested(value: Any, brackets: str, indent: int = 4) -> str:
    """Numbers in brackets, matrix rows on separate lines."""
    left, right = brackets
    if not isinstance(value, list | tuple):
        return repr(value)
    if not value or not isinstance(value[0], list):
        return left + ", ".join(_nested(item, brackets) for item in value) + right
    rows = [" " * indent + _nested(item, brackets, indent + 4) for item in value]
    if brackets == "{}":
        return left + "\n" + ",\n".join(rows) + right
    return left + "\n" + "".join(f"{row},\n" for row in rows) + " " * (indent - 4) + right


def _ascii(text: str) -> str:
    """A line of text in ASCII that ends no comment: names of joints and sets are in it."""
    for character, instead in (ASCII | {"*/": "* /", "/*": "/ *"}).items():
        text = text.replace(character, instead)
    text = "".join(character if character.isprintable() else " " for character in text)
    return text.encode("ascii", "replace").decode()


def _wrapped(lines: Iterable[str]) -> list[str]:
    out: list[str] = []
    for line in lines:
        out += [line] if line.startswith(" ") else textwrap.wrap(line, LINE_LENGTH) or [""]
    return out


def _template(name: str, mark: str, tables: CodeTables) -> tuple[str, str]:
    """What stands before and after `mark` in a template, with the sections that the robot needs.

    InputError for an effect without a section, whose torque the code would miss.
    """
    top, code = (_HERE / name).read_text(encoding="utf-8").split(mark)
    for table in tables.effects.keys() - section_names(code):
        effect = tables.effects[table]
        raise InputError(f"has no section [{table}], expected one for {effect}", file=_HERE / name)
    return top, with_sections(code, tables.sections)


def with_sections(text: str, kept: Collection[str]) -> str:
    """A template reduced to the sections in `kept`."""
    out: list[str] = []
    inside: list[str] = []
    for line in text.splitlines():
        mark = MARK.fullmatch(line)
        if mark is None:
            if all(name in kept for name in inside):
                out.append(line)
        elif mark["open"]:
            inside.append(mark["open"])
        elif not inside or inside.pop() != mark["close"]:
            raise AssertionError(f"section {mark['close']} is not open")
    assert not inside, f"section {inside} is not closed"
    return "\n".join(out) + "\n"


def section_names(text: str) -> set[str]:
    """Names of all template sections."""
    marks = (MARK.fullmatch(line) for line in text.splitlines())
    return {mark["open"] for mark in marks if mark and mark["open"]}
