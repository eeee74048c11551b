"""Where sentences stand in source files: texts that a user would read, by their syntax alone."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

FEWEST_WORDS = 5  # of a sentence
ERROR = re.compile(r"(Error|Package|Warning|NotFound)$")  # classes whose arguments are what an error says
DOCUMENTED = {"ParameterSpec", "Field", "Parameter"}  # whose texts are an effect's or a setting's own help


def sentences(module: ast.Module, *, effects: bool = False) -> Iterator[tuple[int, str]]:
    """Texts of five words or more, with their lines.

    Not those that document (docstrings, help of settings and parameters, with `effects` what a class says of
    itself), and not what errors say, also where the text stands in a variable first.
    """
    apart = set[int]()
    for node in ast.walk(module):
        apart |= documenting(node, effects)
        if isinstance(node, ast.Raise) or (isinstance(node, ast.Call) and ERROR.search(called(node))):
            apart |= inside(node)
        if isinstance(node, ast.FunctionDef):
            raised = (n for n in ast.walk(node) if isinstance(n, ast.Raise))
            names = {n.id for one in raised for n in ast.walk(one) if isinstance(n, ast.Name)}
            for one in ast.walk(node):
                if isinstance(one, ast.Assign | ast.AugAssign | ast.AnnAssign) and assigned(one) & names:
                    apart |= inside(one)
    yield from texts(module, apart)


def documenting(node: ast.AST, effects: bool) -> set[int]:
    """Docstrings of a module, class, function or attribute; texts that a class says of itself."""
    out = set[int]()
    body = getattr(node, "body", None)
    for statement in body if isinstance(body, list) else ():
        if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
            out |= inside(statement)
        own = isinstance(node, ast.ClassDef) and isinstance(statement, ast.Assign | ast.AnnAssign)
        if effects and own:
            out |= inside(statement)
    if isinstance(node, ast.Call) and called(node) in DOCUMENTED:
        out |= inside(node)
    return out


def texts(node: ast.AST, apart: set[int]) -> Iterator[tuple[int, str]]:
    if id(node) in apart:
        return
    text = ""
    if isinstance(node, ast.JoinedStr):
        text = "".join(part.value if isinstance(part, ast.Constant) else "{}" for part in node.values)  # type: ignore[misc]
    elif isinstance(node, ast.Constant) and isinstance(node.value, str):
        text = node.value
    else:
        for child in ast.iter_child_nodes(node):
            yield from texts(child, apart)
    if len(text.split()) >= FEWEST_WORDS:
        yield node.lineno, text  # type: ignore[attr-defined]


def inside(node: ast.AST) -> set[int]:
    return {id(one) for one in ast.walk(node)}


def called(node: ast.Call) -> str:
    """The last name of what is called."""
    return node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")


def assigned(node: ast.Assign | ast.AugAssign | ast.AnnAssign) -> set[str]:
    targets = node.targets if isinstance(node, ast.Assign) else [node.target]
    return {one.id for target in targets for one in ast.walk(target) if isinstance(one, ast.Name)}
