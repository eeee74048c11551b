"""Small changes of a module's code, for `benchmarks.mutants`.

Texts, annotations, decorators, assertions and numbers up to 1e-6 (guards against rounding) are left alone, as
are chosen numbers of examples and starts (`CHOSEN`), and no assignment to a name is left out. Whether a limit
counts itself (< or <=) is changed only where it is no float of the module: a measured number does not meet it
exactly.
"""

from __future__ import annotations

import ast
from typing import Any

SMALLEST = 1e-6  # smaller numbers guard against rounding: half as much again does nothing
CHOSEN = ("typical", "guesses", "grid", "example", "TRIAL")  # functions and names whose numbers are a choice

OPERATIONS: dict[type, type] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult,
    ast.FloorDiv: ast.Div, ast.Mod: ast.Mult, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd,
}  # fmt: skip
COMPARISONS: dict[type, tuple[type, ...]] = {
    ast.Lt: (ast.LtE, ast.GtE), ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE), ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,), ast.NotEq: (ast.Eq,), ast.Is: (ast.IsNot,), ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,), ast.NotIn: (ast.In,),
}  # fmt: skip


def guard(node: ast.expr) -> bool:
    return isinstance(getattr(node, "value", 0), float) and 0.0 < abs(node.value) <= SMALLEST  # type: ignore


class Changer(ast.NodeTransformer):
    """Finds the changes of a module, and makes the one that is wanted."""

    def __init__(self, wanted: int = -1) -> None:
        self.wanted = wanted
        self.floats: set[str] = set()  # the module's constants
        self.found: list[tuple[tuple[int, int], str]] = []
        self.lines = (0, 0)
        self.chosen = False  # within one of `CHOSEN`

    def choose(self, node: Any, *changed: Any) -> Any:
        out = node
        for new in changed:
            if len(self.found) == self.wanted:
                out = ast.fix_missing_locations(ast.copy_location(new, node))
            texts = (" ".join(ast.unparse(ast.fix_missing_locations(n)).split()) for n in (node, new))
            self.found.append((self.lines, " → ".join(texts)))
        return out

    def visit(self, node: ast.AST) -> Any:
        if isinstance(node, ast.stmt):
            body = getattr(node, "body", None)
            end = body[0].lineno - 1 if isinstance(body, list) else node.end_lineno
            self.lines = (node.lineno, max(node.lineno, end or 0))
        strict = isinstance(node, ast.keyword) and node.arg == "strict"  # an assertion, too
        if strict or isinstance(node, ast.Assert | ast.JoinedStr | ast.Import | ast.ImportFrom):
            return node
        outer = self.chosen
        target = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", node)
        self.chosen = outer or getattr(target, "id", getattr(node, "name", "")) in CHOSEN
        changed = super().visit(node)
        self.chosen = outer
        return changed

    def visit_FunctionDef(self, node: ast.FunctionDef) -> Any:
        node.args.defaults = [self.visit(default) for default in node.args.defaults]
        node.args.kw_defaults = [default and self.visit(default) for default in node.args.kw_defaults]
        node.body = [self.visit(statement) for statement in node.body]
        return node

    def visit_ClassDef(self, node: ast.ClassDef) -> Any:
        node.body = [self.visit(statement) for statement in node.body]
        return node

    def visit_AnnAssign(self, node: ast.AnnAssign) -> Any:
        node.value = node.value and self.visit(node.value)
        return node

    def visit_Constant(self, node: ast.Constant) -> Any:
        value = node.value
        if isinstance(value, bool):
            return self.choose(node, ast.Constant(not value))
        if isinstance(value, int):
            return self.choose(node, ast.Constant(value + 1))
        if isinstance(value, float) and not self.chosen and not guard(node):
            return self.choose(node, ast.Constant(1.5 * value if value else 1.0))
        return node

    def visit_BinOp(self, node: ast.BinOp) -> Any:
        self.generic_visit(node)
        other = OPERATIONS.get(type(node.op))
        if any(guard(side) for side in (node.left, node.right)) and isinstance(node.op, ast.Add | ast.Sub):
            return node
        text = isinstance(node.left, ast.Constant | ast.JoinedStr) and not isinstance(
            getattr(node.left, "value", ""), int | float
        )
        return node if other is None or text else self.choose(node, ast.BinOp(node.left, other(), node.right))

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Any:
        self.generic_visit(node)
        return self.choose(node, node.operand)

    def visit_BoolOp(self, node: ast.BoolOp) -> Any:
        self.generic_visit(node)
        return self.choose(
            node, ast.BoolOp(ast.Or() if isinstance(node.op, ast.And) else ast.And(), node.values)
        )

    def visit_Module(self, node: ast.Module) -> Any:
        for line in node.body:
            value = getattr(line, "value", None)
            if isinstance(line, ast.Assign) and isinstance(getattr(value, "value", None), float):
                self.floats |= {target.id for target in line.targets if isinstance(target, ast.Name)}
        return self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> Any:
        limited = any(
            isinstance(getattr(part, "value", 0), float) or getattr(part, "id", "") in self.floats
            for side in (node.left, *node.comparators)
            for part in ast.walk(side)
        )
        self.generic_visit(node)
        if len(node.ops) > 1:
            return self.choose(node, ast.UnaryOp(ast.Not(), node))
        others = COMPARISONS[type(node.ops[0])]
        others = others[-1:] if limited else others
        return self.choose(node, *(ast.Compare(node.left, [other()], node.comparators) for other in others))

    def condition(self, node: Any) -> Any:
        if isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            return node
        lines = self.lines
        self.generic_visit(node)
        self.lines = lines
        if not isinstance(node.test, ast.Compare):  # which has its own
            node.test = self.choose(node.test, ast.UnaryOp(ast.Not(), node.test))
        return node

    visit_If = visit_While = visit_IfExp = condition

    def visit_Return(self, node: ast.Return) -> Any:
        self.generic_visit(node)
        if isinstance(node.value, ast.BinOp):
            node.value = self.choose(node.value, ast.UnaryOp(ast.USub(), node.value))
        return node

    def visit_Assign(self, node: ast.Assign) -> Any:
        self.generic_visit(node)
        kept = any(isinstance(target, ast.Name | ast.Tuple) for target in node.targets)
        return node if kept else self.choose(node, ast.Pass())

    def visit_AugAssign(self, node: ast.AugAssign) -> Any:
        self.generic_visit(node)
        return self.choose(node, ast.Pass())

    def visit_Expr(self, node: ast.Expr) -> Any:
        if isinstance(node.value, ast.Constant):  # a docstring
            return node
        self.generic_visit(node)
        return self.choose(node, ast.Pass())

    def visit_Raise(self, node: ast.Raise) -> Any:
        return self.choose(node, ast.Pass())
