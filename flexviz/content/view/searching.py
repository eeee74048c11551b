"""What is shown while the missing effect is looked for: a matrix that fills in, and the residual so far."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from flexviz.analysis.diagnosis import BestModel
from flexviz.analysis.laws import LawThroughData
from flexviz.content.charts import COLOURS, Chart, ChartAxis, ChartSeries, rgb, thin
from flexviz.content.results import law_chart
from flexviz.content.view.effect_matrix import joint_heads
from flexviz.content.view.residuals import BRIGHT_SHARE
from flexviz.content.wording import effect_text_name, effect_title, escape, plural

MOST_ROWS = 10  # of the matrix
SMALLEST = 0.005  # share of the error below which an effect has no row
HEIGHT = 200  # [px] of the residual
MARGIN = 1.05  # times the first residual: end of the axis
NOW, FIRST = "with the leading candidate", "the model so far"


def alone_html(alone: Mapping[str, float], leading: Sequence[str], joints: Sequence[str]) -> str:
    """Effects × joints: the share of the joint's error that each alone would remove, the largest first.

    `leading`: the effects of the best model, which are ticked. A joint that is still to come has dots.
    """
    if not alone:
        return ""
    places: dict[str, dict[str, float]] = {}  # row → joint → share; "" for an effect of no joint
    for text, share in alone.items():
        name, _, place = text.partition(":")
        row = name if place in joints else text
        places.setdefault(row, {})[place if place in joints else ""] = share
    rows = sorted(places, key=lambda row: -max(places[row].values()))
    shown = [row for row in rows if max(places[row].values()) >= SMALLEST][:MOST_ROWS]
    known = {text.partition(":")[2] for text in alone}

    def cells(row: str) -> str:
        of = places[row]
        if "" in of:
            return _cell(of[""], effect_text_name(row), row in leading, len(joints))
        return "".join(
            _cell(of.get(joint), f"{effect_title(row)}, {joint}", f"{row}:{joint}" in leading)
            if joint in known
            else "<td>…</td>"
            for joint in joints
        )

    def line(row: str) -> str:
        name = escape(effect_text_name(row) if "" in places[row] else effect_title(row))
        return f'<tr><td title="{name}">{name}</td>{cells(row)}</tr>'

    head, tall = joint_heads(joints)
    left = len(places) - len(shown)
    more = f" {plural(left, 'more effect')} would remove less." if left else ""
    return (
        '<div class="fv"><b>What each effect alone would remove of its joint\'s error [%]</b>'
        f'<table class="fv-table fv-heat fv-alone{tall}"><tr><th></th>{head}</tr>'
        f"{''.join(map(line, shown))}</table>"
        f'<div class="fv-dim">Estimated. ✓: in the leading candidate.{more}</div></div>'
    )


def _cell(share: float | None, name: str, leading: bool, columns: int = 1) -> str:
    across = f' colspan="{columns}"' if columns > 1 else ""
    if share is None:
        return f"<td{across}>·</td>"
    share = min(max(share, 0.0), 1.0)
    red, green, blue = rgb(COLOURS.playhead)
    ink = ";color:#000" if share > BRIGHT_SHARE else ""
    return (
        f'<td{across} style="background:rgb({red} {green} {blue} / {share:.2f}){ink}" '
        f'title="{escape(name)}: {100 * share:.1f} %">{100 * share:.0f}{"✓" if leading else ""}</td>'
    )


def worst_joint_so_far(best: BestModel, spread: Sequence[float]) -> int:
    """The joint with the largest residual relative to its torque; `spread` is that of the torque [Nm]."""
    squares = np.concatenate([np.square(residual, dtype=float) for _, residual in best.residuals.values()])
    return int(np.argmax(np.sqrt(squares.mean(axis=0)) / np.maximum(spread, np.finfo(float).tiny)))


def search_charts(
    first: BestModel,
    best: BestModel,
    law: LawThroughData | None,
    joint: int,
    name: str,
    group: str,
    span: tuple[float, float],
) -> tuple[Chart, ...]:
    """The residual of a joint with the best model so far on the axis of the first, and the leader's law."""
    drawn = [residual_so_far(first, best, joint, name, group, span)]
    return (*drawn, law_chart(law)) if law is not None and len(law.at) > 1 else tuple(drawn)


def residual_so_far(
    first: BestModel, best: BestModel, joint: int, name: str, group: str, span: tuple[float, float]
) -> Chart:
    """The residual of a joint [Nm] in a group: that of the first model, and in front the best one's."""
    time, begun = first.residuals[group]
    values = [begun[:, joint], best.residuals[group][1][:, joint]]
    x, (grey, present) = thin(np.asarray(time, float), [np.asarray(one, float) for one in values])
    changed = bool(best.effects)
    lines = [ChartSeries(FIRST, COLOURS.reference if changed else COLOURS.residual, x, grey, 1.2)]
    lines += [ChartSeries(NOW, COLOURS.residual, x, present, 1.4)] if changed else []
    end = MARGIN * float(np.abs(grey).max(initial=0.0)) or 1.0
    title = f"Residual of {name}, {group}: {'searching' if changed else 'the model before the search'}"
    chart = Chart(
        "searching", title, y=ChartAxis("residual", "Nm", limits=(-end, end)), series=tuple(lines),
        playhead=True, height=HEIGHT,
    )  # fmt: skip
    return replace(chart.spans(*span), description=f"{NOW if changed else FIRST}: residual below 5 Hz.")
