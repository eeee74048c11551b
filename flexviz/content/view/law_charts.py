"""The laws of effects through their data, as charts."""

from __future__ import annotations

from collections.abc import Iterable

from flexviz.analysis.diagnosis import Diagnosis
from flexviz.analysis.laws import LawThroughData
from flexviz.content.charts import Chart
from flexviz.content.results import law_chart

SMALL = 200  # [px] height of all charts but the first


def law_charts(
    diagnosis: Diagnosis | None, model: Iterable[LawThroughData] | None, joint: str
) -> tuple[Chart, ...]:
    """The laws of what a diagnosis has found on a joint, then of the model's effects; the first one large."""
    found: dict[str, LawThroughData] = {}
    for law in (*(one.law for one in (diagnosis.findings if diagnosis else ())), *(model or ())):
        if law is not None and law.joint == joint and len(law.at) > 1:
            found.setdefault(law_chart(law).key, law)
    return tuple(law_chart(law, SMALL) if k else law_chart(law) for k, law in enumerate(found.values()))
