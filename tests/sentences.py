"""Where sentences stand in source files: texts that a user would read, by their syntax alone."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

FEWEST_WORDS = 5  # of a sentence
ERROR = re.compile(r"(Error|Package|Warning|NotFound)$|^refuse$")  # called with what an error says
DOCUMENTED = {"ParameterSpec", "Field", "Parameter"}  # whose texts are an effect's or a setting's own help


def sentences(module: ast.Module, *, documented: bool = False) -> Iterator[tuple[int, str]]:
    """Texts of five words or more, with their lines.

    Not those that document (docstrings, `__repr__`, help of settings and parameters, with `documented` what a
    class says of itself), and not what errors say, also where it stands in a variable, a constant or a
    function that nothing else uses.
    """
    apart, raised = set[int](), set[int]()
    for node in ast.walk(module):
        apart |= documenting(node, documented)
        if isinstance(node, ast.Raise | ast.Assert) or (
            isinstance(node, ast.Call) and ERROR.search(called(node))
        ):
            raised |= inside(node)
    while more := explaining(module, raised) - raised:
        raised |= more
    yield from texts(module, apart | raised)


def explaining(module: ast.Module, raised: set[int]) -> set[int]:
    """What errors name: values of variables in their function, constants, functions of no other use."""
    out = set[int]()
    for scope in [n for n in ast.walk(module) if isinstance(n, ast.FunctionDef)] + [module]:
        names = used(scope)
        only = {
            n.id
            for n in names
            if id(n) in raised and (scope is not module or not others(names, n.id, raised))
        }
        for one in ast.walk(scope) if scope is not module else module.body:
            assigns = isinstance(one, ast.Assign | ast.AugAssign | ast.AnnAssign) and assigned(one) & only
            if assigns or (scope is module and isinstance(one, ast.FunctionDef) and one.name in only):
                out |= inside(one)
    return out


def used(scope: ast.AST) -> list[ast.Name]:
    return [n for n in ast.walk(scope) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load)]


def others(names: list[ast.Name], name: str, raised: set[int]) -> bool:
    """Whether a name is also used for something else than errors."""
    return any(n.id == name and id(n) not in raised for n in names)


def documenting(node: ast.AST, documented: bool) -> set[int]:
    """Docstrings of a module, class, function or attribute; texts that a class or a constant is for."""
    out = set[int]()
    body = getattr(node, "body", None)
    for statement in body if isinstance(body, list) else ():
        if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
            out |= inside(statement)
        own = isinstance(node, ast.ClassDef | ast.Module) and isinstance(
            statement, ast.Assign | ast.AnnAssign
        )
        if documented and own:
            out |= inside(statement)
    if isinstance(node, ast.FunctionDef) and node.name == "__repr__":
        out |= inside(node)
    if isinstance(node, ast.Call) and called(node) in DOCUMENTED:
        out |= inside(node)
    return out


def texts(node: ast.AST, apart: set[int]) -> Iterator[tuple[int, str]]:
    if id(node) in apart:
        return
    text = ""
    if isinstance(node, ast.JoinedStr):
        parts = (p.value if isinstance(p, ast.Constant) else "{}" for p in node.values)
        text = "".join(map(str, parts))
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
