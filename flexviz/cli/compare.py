"""`flexviz compare SET SET`: what a compensation removed between two recordings of a robot."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from flexviz.cli import terminal
from flexviz.cli.terminal import Reporter, interruptible

if TYPE_CHECKING:
    from rich.table import Table

    from flexviz.compensation import CompensationComparison
    from flexviz.results import ResultDocument


def compare_sets(without: Path, compensated: Path, json_file: Path | None) -> int:
    """Diagnose a set recorded without and one with compensation, and compare their friction."""
    from flexviz.compensation import compare_friction
    from flexviz.diagnosis import diagnose
    from flexviz.exporting import identified_robot
    from flexviz.measurements import read_set

    found, models = [], []
    with Reporter(f"reading {without}") as report, interruptible("nothing is compared") as should_stop:
        sets = [read_set(path) for path in (without, compensated)]
        for measurements in sets:
            told = diagnose(measurements, apply=True, progress=report, should_stop=should_stop)
            if told.stopped:
                return 130
            found.append(told.document())
            models.append(identified_robot(measurements, told).model)
    compared = compare_friction(sets[0], *models)
    console = terminal.results()
    console.print(friction_by_speed(compared))
    terminal.print_lines([*(one.text for one in compared.joints), *left(found[1])])
    joints = [
        asdict(one)
        | {"removed": one.removed, "speeds": [asdict(s) | {"removed": s.removed} for s in one.speeds]}
        for one in compared.joints
    ]
    names = {"without": sets[0].name, "compensated": sets[1].name}
    document = {"format": 1, **names, "joints": joints, "left": found[1].to_dict()}
    terminal.write_json(json_file, document)
    return 0


def friction_by_speed(compared: CompensationComparison) -> Table:
    """A row per joint and range of speed."""
    from flexviz.results import plain_table
    from flexviz.wording import number, percent

    titles = ["speed", "without [Nm]", "compensated [Nm]", "removed"]
    table = plain_table("joint", numbers=titles)
    for one in compared.joints:
        for speed in one.speeds:
            before, after = number(speed.before, 3), number(speed.after, 3)
            table.add_row(one.joint, speed.text, before, after, percent(speed.removed))
    return table


def left(document: ResultDocument) -> list[str]:
    """What the diagnosis of the compensated set says."""
    from flexviz.results import parts

    texts = [part for part in parts(document, 140) if isinstance(part, str)]
    return ["What is left, by the diagnosis of the compensated set:", *(f"  {text}" for text in texts)]
