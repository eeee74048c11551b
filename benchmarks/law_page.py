"""`python -m benchmarks.law_page OUT.html [--write]`: the law of every effect through its data, to look at.

From one simulated set per effect, the one of `tests/analysis/test_laws.py`, with the right model and with a
wrong one. Beside each picture: mean square of data − law relative to the noise. `--write` makes the pictures
of the right models anew that the effects' pages show.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from benchmarks.command import command
from benchmarks.effect_pages.pages import LAWS
from flexviz.analysis.laws import LawThroughData
from flexviz.content.blocks import Figures
from flexviz.content.charts import Chart
from flexviz.content.charts.svg import FILE, draw_svg
from flexviz.content.view import law_chart
from flexviz.model.effects import EFFECTS
from flexviz.outlets.report import ReportDocument, Section, html
from tests.analysis.test_laws import OTHER, last_law, simulated

HEIGHT = 190  # [px] of a chart


def charts() -> Iterator[Chart]:
    """Two charts per effect: the right model, then a wrong one on the same data."""
    for effect in EFFECTS:
        with tempfile.TemporaryDirectory() as folder:
            measurements, right = simulated(effect, Path(folder) / "set")
            wrong = f"{OTHER.get(effect, 'torque_gain')}:{measurements.joints[1]}"
            yield drawn(f"{effect}", last_law(measurements, right, refine=True))
            yield drawn(f"wrong for {effect}", last_law(measurements, (wrong,), refine=False))
        print(effect, flush=True)


def drawn(key: str, law: LawThroughData) -> Chart:
    """The law's chart with its misfit."""
    chart = law_chart(law, HEIGHT)
    note = f"{key}; mean square {law.chi_square:.2g}, leftover {law.leftover:.2g}"
    return replace(chart, key=key, title=chart.title.partition(":")[0], note=note)


@command
def main(
    out: Annotated[Path, "the page"],
    *,
    write: Annotated[bool, f"write {LAWS.parent.name}/{LAWS.name}, too"] = False,
) -> int:
    drawn = list(charts())
    sections = [Section("Right model, and a wrong one", [Figures(drawn, columns=2)])]
    document = ReportDocument("Laws through simulated data", f"{len(EFFECTS)} effects", [], sections, "")
    out.write_text(html(document), encoding="utf-8")
    if write:
        LAWS.mkdir(parents=True, exist_ok=True)
        for chart in drawn:
            if chart.key in EFFECTS:
                (LAWS / f"{chart.key}.svg").write_text(draw_svg(chart, chart.key, FILE), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
