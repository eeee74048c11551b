"""The robot, and measured against model torque of every joint in a held-out group, before and after."""

from __future__ import annotations

from flexviz.analysis.diagnosis import torque_over_time
from flexviz.base.errors import InputError
from flexviz.content import view
from flexviz.content.blocks import SMALL_HEIGHT, Figures, Section, explanation, section
from flexviz.content.records import stated_errors
from flexviz.content.topics.story import Story
from flexviz.content.topics.topic import Topic, register
from flexviz.content.wording import driving_signal, error_short, error_whole


class Torque(Topic):
    """Small charts of a report, one per joint; none where the data are not those of the results."""

    name = "torque"
    title = "Measured and model torque"

    def section(self, story: Story) -> Section | None:
        group, models = story.shown_group, story.compared
        if group is None or not models or story.changed:
            return None
        try:
            pairs = [(one.model, one.effects) for one in models]
            found = torque_over_time(story.measurements, group, pairs)
        except InputError:  # records too short for the band
            found = None
        if found is None:
            return None
        rounds = [*story.rounds[:1], *story.rounds[1:][-1:]]
        names = [one.name for one in models]
        steps = [one.model.step for one in rounds] or list(story.identified)
        notes = [""] * len(story.joints)
        if steps:
            *before, last = (stated_errors(step, story.spread) for step in steps)
            notes = [
                f"Error {' → '.join([*(error_short(e, j) for e in before), error_whole(last, j)])}."
                for j in range(len(story.joints))
            ]
        signal = driving_signal(story.measurements.drive is not None)
        units = story.measurements.torque_units
        held_out = story.measurements.group(group).validation
        kind = "held out: it was not fitted" if held_out else "fitted"
        first = "before: model 0; after: the present model. " if len(names) > 1 else ""
        goals = story.measurements.drive is not None
        band = "goal less position, simulated from the goals alone" if goals else "below 5 Hz"
        title = "How far the goals are ahead, measured and of the model" if goals else self.title
        return section(
            title,
            explanation(f"Group {group} ({kind}), {band}; {first}In a good model the lines coincide."),
            Figures(view.torque_fit_charts(found, story.joints, names, notes, SMALL_HEIGHT, units, signal)),
        )


register(Torque())
