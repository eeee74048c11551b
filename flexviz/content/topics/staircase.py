"""The error after each added effect: the models, joint by joint and group by group, against the noise."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

from flexviz.analysis.diagnosis import Step
from flexviz.content import wording
from flexviz.content.blocks import (
    FIGURE_HEIGHT,
    LISTED,
    Block,
    Figures,
    Items,
    Paragraph,
    Section,
    TableBlock,
    explanation,
    section,
    table,
)
from flexviz.content.charts import Chart
from flexviz.content.records import JointErrors, StepEntry, stated_errors, total_rms
from flexviz.content.results import ResultDocument, staircase_chart
from flexviz.content.topics.errors import Column, error_table, further_columns
from flexviz.content.topics.robot_picture import robot_picture
from flexviz.content.topics.story import Story
from flexviz.content.topics.topic import Topic, register
from flexviz.content.topics.verdict import fall, joints_of
from flexviz.content.wording import error_in_torque, number, text_names

MAX_MODELS = 7  # columns of a report's table
MEASURE = (
    "Rms of the torque residual in per cent of the spread of the recorded torque, in one frequency band for "
    "all models"
)
MEASURE_FREE = (
    "Rms of simulated minus measured angle in per cent of the spread of goal minus position; every group is "
    "simulated from its goals alone, from its first sample to its last"
)
ABOUT = (
    "of all joints: the mean. The noise is what the sensors alone would leave, the same for all "
    "models. Held-out groups are never fitted. Model 0 is the model of the set"
)


class Staircase(Topic):
    """The fall of the error, and what had absorbed the effects."""

    name = "staircase"
    title = "How the error fell"

    def blocks(self, result: ResultDocument) -> Iterator[Block]:
        if not result.steps:
            return
        joints, steps = joints_of(result), list(named_steps(result.steps, joints_of(result)))
        yield Items([f"model {k}: {name} → {step.verdict}" for k, (name, step) in enumerate(steps)])
        yield joint_table([step for _, step in steps], joints, result.torque_spread)
        if absorbed := wording.moved(step.added for step in result.steps if step.added is not None):
            yield Paragraph(f"before, this had been absorbed by {wording.absorbed_list(absorbed, LISTED)}")

    def section(self, story: Story) -> Section | None:
        steps = story.shown
        if not steps:
            return None
        own = text_names((*story.measurements.effects, *story.rounds[0].model.effects), story.joints)
        first = f", with {', '.join(own)}" if own else ""
        adds = "".join(f"; {k} adds {name or 'nothing'}" for k, (name, _, _) in enumerate(story.runs) if k)
        return section(
            self.title if len(steps) > 1 else "The error",
            *_top(story, steps),
            explanation(
                f"{MEASURE if story.measurements.drive is None else MEASURE_FREE}; {ABOUT}{first}{adds}."
            ),
            _groups(story, steps),
            joint_table(steps, story.joints, story.spread, MAX_MODELS) if len(story.joints) > 1 else None,
        )


register(Staircase())


def named_steps(steps: Sequence[StepEntry], joints: Sequence[str]) -> Iterator[tuple[str, StepEntry]]:
    """The first model, and the last one of every run of effects of one kind, with their names."""
    yield "present model", steps[0]
    added = [step.added for step in steps[1:] if step.added is not None]
    families = wording.tied_families(added)
    for name, _, last in wording.text_runs([[one.text] for one in added], joints, families):
        yield f"+ {name}", steps[last + 1]


def joint_table(
    steps: Sequence[StepEntry], joints: Sequence[str], spread: Sequence[float], most: int | None = None
) -> TableBlock:
    """The error of each joint with each model, the share that the last one explains, and the noise.

    At most the first and the last models, `most` together.
    """
    held_out, count = all(step.rms_validation for step in steps), len(steps[0].rms)
    rms = [(step.rms_validation or step.rms) if held_out else step.rms for step in steps]
    errors = [JointErrors(one, spread, steps[-1].noise_floor, steps[-1].units) for one in rms]
    last, shown = errors[-1], columns(len(steps), most or len(steps))
    cells: dict[str, Column] = {f"model {k}": partial(_error, errors[k]) for k in shown}
    cells |= {"last": partial(error_in_torque, last), **further_columns(steps[-1], last)}
    caption = f"Rms residual of each joint [{last.unit}], {'held-out' if held_out else 'fitted'} groups"
    names = joints if len(joints) == count else [""] * count
    return error_table(names, cells, caption, last.relative and count > 1)


def _error(errors: JointErrors, joint: int | None) -> str:
    return number(errors.of(joint), 3)


def _top(content: Story, steps: Sequence[Step]) -> list[Figures]:
    """The error step by step, next to a picture of the robot."""
    group = content.shown_group
    picture = None if group is None else robot_picture(content, group)
    chart = _chart(content, steps) if len(steps) > 1 else None
    shown = [one for one in (chart, picture) if one is not None]
    return [Figures(shown, columns=2)] if shown else []


def _chart(content: Story, steps: Sequence[Step]) -> Chart:
    chart = staircase_chart(steps, spread=content.spread)
    words = f"{fall(steps, content.spread)} {chart.description}"
    return replace(chart, description=words, note=words, height=FIGURE_HEIGHT)


def _groups(content: Story, steps: Sequence[Step]) -> TableBlock:
    shown = columns(len(steps), MAX_MODELS)

    def mean(rms: Sequence[float]) -> str:
        return number(JointErrors(rms, content.spread).mean, 3)

    rows = []
    for name, used, found in _of_groups(steps):
        rows.append([name, used, *("–" if (row := found[k]) is None else mean(row) for k in shown)])
    rows = rows or [["all", "fit", *(mean(steps[k].rms) for k in shown)]]
    head = ("group", "used to", *(f"model {k}" for k in shown))
    unit = stated_errors(steps[-1], content.spread).unit
    caption = f"Rms residual of each group, mean of all joints [{unit}]"
    return table(head, rows, range(2, len(head)), caption)


def group_rows(steps: Sequence[Step]) -> list[tuple[str, str, list[float]]]:
    """(group, "fit" or "validate", error at each step [Nm]); NaN for steps without the group."""
    out = [
        (name, used, [float("nan") if rms is None else total_rms(rms) for rms in found])
        for name, used, found in _of_groups(steps)
    ]
    return out or [("all", "fit", [total_rms(step.rms) for step in steps])]


def _of_groups(steps: Sequence[Step]) -> Iterator[tuple[str, str, Sequence[Sequence[float] | None]]]:
    """Each group of the last step, its use, and its errors at every step."""
    for last in steps[-1].groups:
        found = [next((one.rms for one in step.groups if one.name == last.name), None) for step in steps]
        yield last.name, "validate" if last.validation else "fit", found


def columns(count: int, most: int) -> list[int]:
    """The models shown in a table: the first and the last ones, at most `most`."""
    return list(range(count)) if count <= most else [0, *range(count - most + 1, count)]
