"""The packages of the rooms and their imports: `python -m benchmarks.architecture [--write]`.

Prints the size of each package, import circles, and imports that bypass a package's public face. With
`--write` it draws the pictures of docs/architecture.md. The exit code is 1 if there is a circle or a bypassed
face.
"""

from __future__ import annotations

import ast
import sys
from collections import defaultdict
from collections.abc import Sequence
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Annotated

from benchmarks.command import command

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "flexviz"
IMAGES = ROOT / "docs" / "images"
BOX, GAP, ROW, MARGIN = (124, 34), 14, 62, 16  # [px]
STYLE = (
    "<style>svg{background:#fff}rect{fill:#eef3f7;stroke:#5d6b78}path{fill:none;stroke:#0072b2;opacity:.55}"
    "text{font:12px 'DejaVu Sans',sans-serif;text-anchor:middle;fill:#1c2733}"
    "text.n{font-size:9px;fill:#5d6b78}</style>\n"
)
WALKS = {  # picture -> (where, what comes out of it), stop by stop
    "walk-diagnosis": (
        ("measurements.read_set", "MeasurementSet"),
        ("equation.build_signals", "Signals"),
        ("equation.Equation.at", "OperatingPoint"),
        ("Coarse.begin", "Model with Score"),
        ("Search on Coarse", "coarse model, trace"),
        ("Search on Fine", "final model"),
        ("Estimator, findings", "Stair, Finding"),
        ("_Diagnosis.described", "Diagnosis, verdict"),
    ),
    "walk-slider": (
        ("Page.watch", "Event"),
        ("EventQueue.take", "action"),
        ("ObserverStep", "bandwidth"),
        ("Store.change", "Changed.OBSERVER"),
        ("ChangeSignal.tell", "subscribers"),
        ("PlotPanel, view", "Chart"),
        ("uplot", "plot"),
    ),
}


def unit_of(parts: Sequence[str]) -> str:
    """Package or module of a room, as "model/effects", of a place in flexviz/; "flexviz" outside them."""
    return "/".join(parts[:2]) if len(parts) > 1 and parts[1] != "__init__" else "flexviz"


def imported(path: Path) -> set[str]:
    """Modules of flexviz that a file imports, wherever in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return {name for name in found if name.startswith("flexviz.")}


def arrows() -> tuple[dict[str, set[str]], dict[str, int], list[str]]:
    """Package -> imported packages; lines per package; imports that bypass a public face."""
    out: dict[str, set[str]] = defaultdict(set)
    lines: dict[str, int] = defaultdict(int)
    bypasses = []
    for path in sorted(PACKAGE.rglob("*.py")):
        here = unit_of(path.relative_to(PACKAGE).with_suffix("").parts)
        lines[here] += len(path.read_text(encoding="utf-8").splitlines())
        for name in imported(path):
            other = unit_of(name.split(".")[1:])
            if other == here or not ((PACKAGE / other).is_dir() or (PACKAGE / f"{other}.py").is_file()):
                continue
            out[here].add(other)
            inside = PACKAGE.joinpath(*name.split(".")[1:4]).with_suffix(".py")
            if len(name.split(".")) > 4 and inside.is_file():
                bypasses.append(f"{path.relative_to(ROOT)} imports {name}")
    return out, dict(lines), bypasses


def levels(graph: dict[str, set[str]]) -> dict[str, int]:
    """Height of each package above those that import nothing."""
    height: dict[str, int] = {}
    for name in TopologicalSorter(graph).static_order():
        height[name] = max((height[other] + 1 for other in graph.get(name, ())), default=0)
    return height


def reduced(graph: dict[str, set[str]]) -> dict[str, set[str]]:
    """The arrows that are not implied by others (transitive reduction)."""
    reach: dict[str, set[str]] = {}
    for name in TopologicalSorter(graph).static_order():
        reach[name] = set().union(*({other} | reach[other] for other in graph.get(name, ())))
    return {
        name: {o for o in others if not any(o in reach[p] for p in others if p != o)}
        for name, others in graph.items()
    }


def svg(graph: dict[str, set[str]], lines: dict[str, int]) -> str:
    """The picture: one box per package, arrows down to what it imports."""
    names = [name for name in lines if (PACKAGE / name).is_dir()]
    graph = {name: {other for other in graph.get(name, ()) if other in names} for name in names}
    height, rows = levels(graph), defaultdict(list)
    for name in sorted(names):
        rows[height[name]].append(name)
    top, widest = max(rows), max(len(row) for row in rows.values())
    width = 2 * MARGIN + widest * BOX[0] + (widest - 1) * GAP
    at = {}
    for level, row in rows.items():
        left = (width - len(row) * BOX[0] - (len(row) - 1) * GAP) / 2
        for place, name in enumerate(row):
            at[name] = left + place * (BOX[0] + GAP), MARGIN + (top - level) * ROW
    parts = []
    for name, others in sorted(reduced(graph).items()):
        for other in sorted(others):
            (x, y), (u, v) = at[name], at[other]
            x, u, y = x + BOX[0] / 2, u + BOX[0] / 2, y + BOX[1]
            bend = (v - y) / 2
            parts.append(f'<path d="M{x:g} {y:g} C{x:g} {y + bend:g} {u:g} {v - bend:g} {u:g} {v:g}"/>')
    boxes = []
    for name, (x, y) in at.items():
        boxes.append(f'<rect x="{x:g}" y="{y:g}" width="{BOX[0]}" height="{BOX[1]}" rx="4"/>')
        room, package = name.split("/")
        below = f"{room}, {lines[name]:,} lines"
        boxes.append(f'<text x="{x + BOX[0] / 2:g}" y="{y + 15:g}">{package}</text>')
        boxes.append(f'<text class="n" x="{x + BOX[0] / 2:g}" y="{y + 28:g}">{below}</text>')
    total = 2 * MARGIN + top * ROW + BOX[1]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {total:g}" width="{width:g}">\n'
        + STYLE
        + "\n".join(parts + boxes)
        + "\n</svg>\n"
    )


def walk(stops: tuple[tuple[str, str], ...]) -> str:
    """A picture of stops, four in a row, with what each hands to the next."""
    wide, parts = 190, []
    for number, (where, result) in enumerate(stops):
        x, y = MARGIN + (number % 4) * (wide + 40), MARGIN + (number // 4) * 74
        parts.append(f'<rect x="{x}" y="{y}" width="{wide}" height="46" rx="4"/>')
        parts.append(f'<text x="{x + wide / 2:g}" y="{y + 19}">{number + 1}  {where}</text>')
        parts.append(f'<text class="n" x="{x + wide / 2:g}" y="{y + 35}">→ {result}</text>')
        if number % 4 < 3 and number + 1 < len(stops):
            parts.append(f'<path d="M{x + wide} {y + 23} h34 m-7 -5 l7 5 l-7 5"/>')
    width, rows = 2 * MARGIN + 4 * wide + 120, (len(stops) + 3) // 4
    height = 2 * MARGIN + 46 + (rows - 1) * 74
    size = f'viewBox="0 0 {width} {height}" width="{width}"'
    body = "\n".join(parts)
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size}>\n{STYLE}{body}\n</svg>\n'


@command
def main(*, write: Annotated[bool, "renew the pictures in docs/images"] = False) -> int:
    graph, lines, bypasses = arrows()
    try:
        height = levels(graph)
    except CycleError as error:
        print("circle:", " -> ".join(error.args[1]))
        return 1
    for name in sorted(lines, key=lambda name: (-height.get(name, 0), name)):
        print(f"{height.get(name, 0):3d}  {name:24s} {lines[name]:6,d} lines")
    print(
        f"{sum(lines.values()):,} lines in {len(lines)} packages and modules; {len(bypasses)} faces bypassed"
    )
    print(*bypasses, sep="\n")
    if write:
        (IMAGES / "packages.svg").write_text(svg(graph, lines), encoding="utf-8")
        for name, stops in WALKS.items():
            (IMAGES / f"{name}.svg").write_text(walk(stops), encoding="utf-8")
    return 1 if bypasses else 0


if __name__ == "__main__":
    sys.exit(main())
