"""How many numbers decide: `python -m benchmarks.constants [count] [--tree DIR]`.

    count   lines of flexviz and of its diagnosis; the numeric constants of the latter and their places
    worth   what each constant is worth: `worth SET ... --work DIR` halves and doubles each and prints which
            sets are answered otherwise; those that change none could go

A constant is a number, or a tuple or dictionary of numbers: a field of a dataclass of thresholds
(`threshold`) or a name of a module (`constant`). Numbers that a class or a function has as defaults are
listed apart.
"""

from __future__ import annotations

import ast
import shlex
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from typer import BadParameter

from benchmarks.command import command

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = Path("flexviz") / "analysis" / "diagnosis"
WRAPPERS = {"tuple", "frozenset", "array", "MappingProxyType", "dict", "float", "sqrt", "log", "exp"}
NUMBERS = {"pi", "inf", "e"}  # of math or numpy
THRESHOLD, CONSTANT, DEFAULT = "threshold", "constant", "default"


@dataclass(frozen=True)
class Constant:
    """A number that stands in the code.

    Attributes:
        kind: THRESHOLD, CONSTANT or DEFAULT.
        name: with that of its class or function.
        value: as written.
        file, line: where.
    """

    kind: str
    name: str
    value: str
    file: Path
    line: int


def count_lines(folder: Path) -> tuple[int, int]:
    """Lines and number of the Python files of a folder."""
    files = sorted(folder.rglob("*.py"))
    return sum(len(file.read_text(encoding="utf-8").splitlines()) for file in files), len(files)


def constants(tree: Path) -> list[Constant]:
    """Those of flexviz/analysis/diagnosis in a source tree."""
    out = []
    for file in sorted((tree / PACKAGE).rglob("*.py")):
        module = ast.parse(file.read_text(encoding="utf-8"), filename=str(file))
        for kind, name, value in module_constants(module, file.stem == "thresholds"):
            out.append(Constant(kind, name, ast.unparse(value), file.relative_to(tree), value.lineno))
    return out


def module_constants(module: ast.Module, all_thresholds: bool) -> Iterator[tuple[str, str, ast.expr]]:
    """(kind, name, value) of every one in a module; `all_thresholds`: each of its dataclasses holds some."""
    for node in module.body:
        for name, value in _assigned(node):
            if is_numeric(value) and not name.startswith("__"):
                yield CONSTANT, name, value
    for node in ast.walk(module):
        if isinstance(node, ast.ClassDef) and not _is_enum(node):
            named = all_thresholds or node.name.endswith("Thresholds")
            kind = THRESHOLD if named and _is_dataclass(node) else DEFAULT
            for name, value in (pair for statement in node.body for pair in _assigned(statement)):
                if is_numeric(value):
                    yield kind, f"{node.name}.{name}", value
        elif isinstance(node, ast.FunctionDef):
            for name, value in _defaults(node.args):
                if is_numeric(value):
                    yield DEFAULT, f"{node.name}({name})", value


def is_numeric(value: ast.expr) -> bool:
    """Whether it is a number, or is made of numbers only."""
    match value:
        case ast.Constant(value=number):
            return isinstance(number, int | float) and not isinstance(number, bool)
        case ast.UnaryOp(operand=operand):
            return is_numeric(operand)
        case ast.BinOp(left=left, right=right):
            # another constant may take part, as in 1 / HERTZ
            parts = [part for part in (left, right) if not isinstance(part, ast.Name)]
            return bool(parts) and all(map(is_numeric, parts))
        case ast.Tuple(elts=parts) | ast.List(elts=parts) | ast.Set(elts=parts):
            return bool(parts) and all(map(is_numeric, parts))
        case ast.Dict(values=parts):
            return bool(parts) and all(map(is_numeric, parts))
        case ast.Attribute(attr=name):
            return name in NUMBERS
        case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name), args=[first, *_]):
            return name in WRAPPERS and is_numeric(first)
    return False


def _assigned(node: ast.stmt) -> Iterator[tuple[str, ast.expr]]:
    """Names and values of an assignment; (A, B) = (1, 2) and A, B = 1, 2 are two."""
    if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.value is not None:
        yield node.target.id, node.value
    if isinstance(node, ast.Assign):
        for target in node.targets:
            if isinstance(target, ast.Name):
                yield target.id, node.value
            elif isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                pairs = zip(target.elts, node.value.elts, strict=False)
                yield from ((t.id, v) for t, v in pairs if isinstance(t, ast.Name))


def _defaults(given: ast.arguments) -> Iterator[tuple[str, ast.expr]]:
    """Arguments with a default."""
    placed = [*given.posonlyargs, *given.args]
    last = placed[len(placed) - len(given.defaults) :]
    yield from ((a.arg, value) for a, value in zip(last, given.defaults, strict=True))
    named = zip(given.kwonlyargs, given.kw_defaults, strict=True)
    yield from ((a.arg, value) for a, value in named if value is not None)


def _is_dataclass(node: ast.ClassDef) -> bool:
    return any("dataclass" in ast.unparse(d) for d in node.decorator_list)


def _is_enum(node: ast.ClassDef) -> bool:
    return any(ast.unparse(base).endswith(("Enum", "Flag")) for base in node.bases)


def report(tree: Path) -> str:
    """The counts, and every constant."""
    found = constants(tree)
    lines = []
    for kind in (THRESHOLD, CONSTANT, DEFAULT):
        lines += [f"{c.file}:{c.line}: {kind} {c.name} = {c.value}" for c in found if c.kind == kind]
    for folder in (PACKAGE.parents[1], PACKAGE):
        lines.append("{}: {:,} lines in {} files".format(folder, *count_lines(tree / folder)))
    number = {kind: sum(c.kind == kind for c in found) for kind in (THRESHOLD, CONSTANT, DEFAULT)}
    counted = number[THRESHOLD] + number[CONSTANT]
    lines.append(
        f"{counted} numeric constants: {number[THRESHOLD]} thresholds and {number[CONSTANT]} of modules; "
        f"besides, {number[DEFAULT]} numbers as defaults"
    )
    return "\n".join(lines)


@command
def main(
    what: Annotated[Literal["count", "worth"], "what to do"] = "count",
    sets: Annotated[list[Path] | None, "measurement sets, of `worth`"] = None,
    *,
    tree: Annotated[Path, "another checkout, of `count`"] = ROOT,
    work: Annotated[Path | None, "keeps what `worth` has found"] = None,
    command: Annotated[str, "of `worth`: the Python that has the version"] = sys.executable,
    only: Annotated[str, "constants with this text in their names"] = "",
) -> int:
    if what == "count":
        print(report(tree))
        return 0
    if work is None or not sets:
        raise BadParameter("worth needs --work DIR and a SET")
    from benchmarks.constant_worth import measure

    print(measure(shlex.split(command), sets, work, only))
    return 0


if __name__ == "__main__":
    sys.exit(main())
