"""The robot, and measured against model torque of every joint in a held-out group, before and after."""

from __future__ import annotations

from flexviz.analysis.diagnosis import torque_over_time
from flexviz.base.errors import InputError
from flexviz.content.wording import stated_errors
from flexviz.outlets import view
from flexviz.outlets.report.blocks import SMALL_HEIGHT, Figures, Section, explanation, section
from flexviz.outlets.report.content import ReportContent


def torque(content: ReportContent) -> Section | None:
    """Small charts, one per joint; None without a model or where the data are not those of the results."""
    group, models = content.shown_group, content.compared
    if group is None or not models or content.changed:
        return None
    try:
        pairs = [(one.model, one.effects) for one in models]
        found = torque_over_time(content.measurements, group, pairs)
    except InputError:  # records too short for the band
        found = None
    if found is None:
        return None
    rounds = [*content.rounds[:1], *content.rounds[1:][-1:]]
    names = [one.name for one in models]
    steps = [one.model.step for one in rounds] or list(content.identified)
    notes = [""] * len(content.joints)
    if steps:
        errors = [stated_errors(step, content.spread) for step in steps]
        notes = [
            f"Error {' → '.join([*(one.short(j) for one in errors[:-1]), errors[-1].whole(j)])}."
            for j in range(len(content.joints))
        ]
    units = content.measurements.torque_units
    held_out = content.measurements.group(group).validation
    kind = "held out: it was not fitted" if held_out else "fitted"
    first = "before: model 0; after: the present model. " if len(names) > 1 else ""
    return section(
        "Measured and model torque",
        explanation(f"Group {group} ({kind}), below 5 Hz; {first}In a good model the lines coincide."),
        Figures(view.torque_fit_charts(found, content.joints, names, notes, SMALL_HEIGHT, units)),
    )
