"""The robot, and measured against model torque of every joint in a held-out group, before and after."""

from __future__ import annotations

from flexviz import view
from flexviz.diagnosis import torque_over_time
from flexviz.errors import InputError
from flexviz.report.blocks import SMALL_HEIGHT, Figures, Section, explanation, section
from flexviz.report.content import ReportContent
from flexviz.report.sections.summary import judged
from flexviz.wording import normalised, percent


def torque(content: ReportContent) -> Section | None:
    """Small charts, one per joint; None without a model or where the data are not those of the results."""
    group = shown_group(content)
    if group is None or content.changed:
        return None
    rounds = [*content.rounds[:1], *content.rounds[1:][-1:]]
    models = [(one.model.step.model, one.model.effects) for one in rounds]
    identified, names = content.identification, ["before", "after"] if len(models) > 1 else ["model"]
    if not models and identified is not None:
        models = [(identified.model, content.analysis.effects)]
    known = [(model, effects) for model, effects in models if model is not None]
    try:
        complete = known and len(known) == len(models)
        found = torque_over_time(content.measurements, group, known) if complete else None
    except InputError:  # a model of another version, or records too short for the band
        found = None
    if found is None:
        return None
    steps = [one.model.step for one in rounds] or list(content.identified)
    notes = [""] * len(content.joints)
    if steps:
        errors = [normalised(judged(step), content.spread) for step in steps]
        notes = [
            "Error " + " → ".join(percent(error[j]) for error in errors) + " of the torque."
            for j in range(len(content.joints))
        ]
    held_out = content.measurements.group(group).validation
    kind = "held out: it was not fitted" if held_out else "fitted"
    first = "before: model 0; after: the present model. " if len(names) > 1 else ""
    return section(
        "Measured and model torque",
        explanation(f"Group {group} ({kind}), below 5 Hz; {first}In a good model the lines coincide."),
        Figures(view.torque_fit_charts(found, content.joints, names, notes, SMALL_HEIGHT)),
    )


def shown_group(content: ReportContent) -> str | None:
    """The longest held-out group, else the longest fitted one."""
    roles = dict(content.analysis.roles)
    groups = [group for group in content.measurements.groups if roles.get(group.name) != "ignore"]
    held_out = [group for group in groups if roles.get(group.name) == "validate"]
    longest = max(held_out or groups, key=lambda group: group.duration, default=None)
    return None if longest is None else longest.name
