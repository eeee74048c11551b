"""The measurement set: what was recorded of which robot, and its groups."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from flexviz.content.blocks import LISTED, Block, Paragraph, TableBlock, explanation, table, warning
from flexviz.content.wording import listed, mounting_text, number, plain_name, plural, temperature_text
from flexviz.data.measurements import Group, MeasurementSet

SIMULATED = "Simulated data: a simulator wrote this measurement set, no robot was recorded."
LONG = 600.0  # [s] from which a recording is told in minutes


def set_rows(measurements: MeasurementSet) -> list[list[str]]:
    """What every page says of a set."""
    seconds = sum(group.duration for group in measurements.groups)
    length = f"{number(seconds, 3)} s" if seconds < LONG else f"{number(seconds / 60, 3)} min"
    recorded = f"{plural(len(measurements.groups), 'group')}, {length}, {rate_text(measurements.groups)} Hz"
    return [
        ["Robot", f"{measurements.robot.name}, {plural(measurements.n, 'joint')}"],
        ["Mounting", mounting_text(measurements.robot.gravity) or "upright"],
        ["Recorded", recorded],
        driven_row(measurements),
        ["Effects in the set", ", ".join(map(plain_name, measurements.effects)) or "none"],
    ]


def driven_row(measurements: MeasurementSet) -> list[str]:
    """What is known of what drives the joints."""
    drive = measurements.drive
    if drive is None:
        gains = "given: replayed in closed loop" if measurements.kp is not None else "not given"
        return ["Controller gains", gains]
    same = "; ".join(listed(list(names)) for names in drive.same)
    kp = f"kp {', '.join(f'{value:g}' for value in drive.kp)} Nm/rad" if drive.kp else "kp estimated"
    return ["Driven by", f"goals of servos, no torque recorded; {kp}{f'; alike: {same}' if same else ''}"]


def rate_text(groups: Sequence[Group]) -> str:
    """ "500", or the least and the highest sampling rate [Hz]."""
    rates = sorted({round(1.0 / segment.step) for group in groups for segment in group.segments})
    return "–" if not rates else f"{rates[0]:g}" if len(rates) == 1 else f"{rates[0]:g}–{rates[-1]:g}"


def set_blocks(measurements: MeasurementSet, missing: Sequence[str] = ()) -> list[Block]:
    """A set in the app; `missing` are the reasons for meshes that are not drawn."""
    warnings = [*map(str, measurements.warnings[:LISTED])]
    if missing:
        more = f" (and {plural(len(missing) - 1, 'other')})" if len(missing) > 1 else ""
        warnings.append(f"Drawn as sticks where meshes are missing: {missing[0]}{more}")
    out: list[Block] = [Paragraph(measurements.name, strong=True)]
    out += [explanation(SIMULATED)] if measurements.simulated else []
    return [*out, table(("", ""), set_rows(measurements)), *map(warning, warnings)]


def group_table(groups: Sequence[Group], roles: Mapping[str, str]) -> TableBlock:
    """A row per group: what was carried, what it is used for, how much of it there is."""
    warm = any(group.temperature is not None for group in groups)
    rows = [
        [
            group.name,
            group.trajectory,
            group.payload,
            *([temperature_text(group.temperature) or "–"] if warm else []),
            roles.get(group.name, "not used"),
            number(group.duration, 3),
            rate_text([group]),
            str(group.samples),
            str(len(group.segments)),
        ]
        for group in groups
    ]
    head = ["group", "trajectory", "payload", "used to", "length [s]", "rate [Hz]", "samples", "pieces"]
    head[3:3] = ["temperature"] if warm else []
    return table(head, rows, tuple(range(len(head) - 4, len(head))))
