"""The model's parameters: values, 95 % intervals, units, what the data determine of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

from flexviz.analysis.identification import Identification
from flexviz.base.statistics import NORMAL_95
from flexviz.content import blocks
from flexviz.content.blocks import LISTED, Cell, Paragraph, explanation, warning
from flexviz.content.records import Combination, CurveTable, ParameterEstimate
from flexviz.content.results import ResultDocument
from flexviz.content.topics.link_side import link_side_blocks
from flexviz.content.topics.story import Story
from flexviz.content.topics.topic import Topic, register
from flexviz.content.view import Truth, model_curve_charts, physical
from flexviz.content.wording import (
    MARKS,
    SYMBOLS,
    determined,
    effect_title,
    estimate_cells,
    estimate_mark,
    interval,
    joints_text,
    number,
    plain_name,
    plural,
    si_scale,
    told,
    unit_text,
)
from flexviz.robot.model import INERTIAL_NAMES

MAX_PLACES = 8  # columns of a table, names of a sentence
LARGE = ((1e-6, "M", 1e7), (1e-3, "k", 1e4))  # factor, prefix, and from which value on
INERTIAL_HEAD = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
SHORT = "a value – is not determined by these data"


class Parameters(Topic):
    """The values of an identification; those of a diagnosis stand at its findings."""

    name = "parameters"
    title = "Parameters"

    def blocks(self, result: ResultDocument) -> Iterator[blocks.Block]:
        if result.verdict is None:
            yield _table(physical(result.all_parameters))
            for curve in result.curves:
                yield curve_table(curve)
            yield combination_table(result.base_parameters)

    def section(self, story: Story) -> blocks.Section | None:
        found = story.parameters
        if not found:
            return None
        inertial = [p for p in found if p.name in INERTIAL_NAMES]
        main = [p for p in physical(found) if p.name not in INERTIAL_NAMES]
        return blocks.section(
            self.title,
            explanation(_source(story)),
            *_main(main),
            explanation(_ties(main, story.joints)) if any(p.tied_to for p in main) else None,
            *model_curve_charts(found, blocks.FIGURE_HEIGHT),
            parts=[_inertias(story, inertial)] if inertial else (),
        )


register(Parameters())


def _table(parameters: Iterable[ParameterEstimate]) -> blocks.TableBlock:
    """One row per parameter, by the names that commands and files use, in SI units."""
    rows, faint = [], []
    for index, p in enumerate(parameters):
        faint += [] if p.identifiable == "yes" else [index]
        value, half = estimate_cells(p)
        short = "" if told(p) else "–"
        grade = p.identifiable + (", at bound" if p.at_bound else "")
        cells = (Cell(value, short=short), Cell(half, short=short), p.unit, grade, ", ".join(p.tied_to))
        rows.append([p.name, p.joint or "", number(p.start), *cells])
    head = ("parameter", "joint", "start", "value", "± 95 %", "unit", "identifiable", "tied to")
    return blocks.table(
        head, rows, (2, 3, 4), fold=(1, 6), below={7: "is tied to"}, faint=faint, shorts=SHORT
    )


def parameter_panel(
    result: Identification | None, truth: Truth | None = None, goals: bool = False
) -> list[blocks.Block]:
    """The same by symbols and joints, with SI prefixes, and the `truth` of a simulated set on request.

    Joints that follow `goals` need no observer, which could be refined.
    """
    if result is None:
        waiting = explanation("The parameters appear here after Run.")
        return [waiting] if truth is None else [Paragraph(_hidden(truth)), waiting]
    main = [p for p in physical(result.parameters) if p.name not in INERTIAL_NAMES]
    inertial = [p for p in result.parameters if p.name in INERTIAL_NAMES]
    hidden = [] if truth is None else [Paragraph(_hidden(truth))]
    out: list[blocks.Block] = [*hidden, _symbols(main, truth, not goals), *link_side_blocks(result)]
    legend = " ".join(f"{MARKS[k]} {k}" for k in MARKS)
    out.append(explanation(f"id. = identifiable: {legend}. ⚑ at its bound."))
    if not result.refined and not goals:
        text = "± 95 % does not cover lag and droop of the filter: Refine removes the observer's bias."
        out.append(explanation(text))
    if len(main) + len(inertial) < len(result.parameters):
        out.append(explanation("Free curves (not physics): see the plots, Where it fails."))
    if inertial:
        out.append(blocks.Details(f"Inertial parameters ({len(inertial)})", [_symbols(inertial, truth)]))
    return out


def _hidden(truth: Truth) -> str:
    """The effects hidden in a simulated set."""
    found = [
        f"{plain_name(name)}{f' of {place}' if place else ''} {number(value)}"
        for (name, place), value in truth.items()
        if "." in name
    ]
    said = f"the hidden effects were {'; '.join(found)}" if found else "no effect was hidden"
    return f"Truth: {said}."


def _symbols(
    parameters: Iterable[ParameterEstimate], truth: Truth | None, started: bool = True
) -> blocks.TableBlock:
    """`started`: from values of their own, which are told."""
    rows = []
    for p in parameters:
        half = NORMAL_95 * p.std if math.isfinite(p.std) else 0.0
        factor, unit = si_scale(max(abs(p.value), half), p.unit)
        value, error = estimate_cells(p, factor)
        known = math.nan if truth is None else truth.get((p.name, p.payload or p.joint), math.nan)
        real = [] if truth is None else [Cell(number(factor * known), tone="truth")]
        label = SYMBOLS.get(p.name, plain_name(p.name)) + (f", {p.payload}" if p.payload else "")
        name = Cell(label + (" ⚑" if p.at_bound else ""), tip=plain_name(p.name))
        grade = Cell(f"{MARKS.get(p.identifiable, '')} {p.identifiable}", tone=p.identifiable)
        ties = ", ".join(map(_tied, p.tied_to[:LISTED])) + (" …" if len(p.tied_to) > LISTED else "")
        start = [number(None if p.start is None else factor * p.start, 3)] if started else []
        rows.append([name, p.joint or "", *start, Cell(value, strong=True), error, *real, unit, grade, ties])
    head = ["", "", *(["start"] if started else []), "value", "± 95 %"]
    head += [*(["truth"] if truth is not None else []), "unit", "id.", ""]
    last = len(head) - 1
    return blocks.table(head, rows, (2, 3, 4) if started else (2, 3), group=1, below={last: "tied to"})


def _tied(name: str) -> str:
    """ "motor_viscous_friction:joint1" as "f_mv of joint1"."""
    parameter, _, place = name.partition(":")
    return SYMBOLS.get(parameter, plain_name(parameter)) + (f" of {place}" if place else "")


def check_blocks(result: Identification | None) -> list[blocks.Block]:
    """Number of identifiable parameters, and the names of the others.

    Inertial parameters are counted as combinations, because single ones are seldom identifiable.
    """
    if result is None:
        return []
    main = [p for p in result.parameters if p.name not in INERTIAL_NAMES]
    weak, no = ([p for p in main if p.identifiable == grade] for grade in ("weak", "no"))
    good = len(main) - len(weak) - len(no)
    count = f"{good} of {len(main)}" if weak or no else f"All {len(main)}"
    out: list[blocks.Block] = [
        Paragraph("Checked with these groups and effects", strong=True),
        Paragraph(f"{count} parameters of joints and effects can be identified."),
    ]
    out += [warning(f"Weak: {parameter_names(weak)}.")] if weak else []
    out += [warning(f"Not identifiable: {parameter_names(no)}.")] if no else []
    if result.combinations:
        good = sum(c.identifiable == "yes" for c in result.combinations)
        out.append(explanation(f"Inertia: {good} of {len(result.combinations)} combinations."))
    return out


def parameter_names(parameters: Sequence[ParameterEstimate]) -> str:
    """The first `MAX_PLACES` names, "K joint1", and the number of others."""
    first = parameters[:MAX_PLACES]
    names = [f"{SYMBOLS.get(p.name, plain_name(p.name))} {p.joint or ''}".strip() for p in first]
    more = len(parameters) - MAX_PLACES
    return ", ".join(names) + (f" and {plural(more, 'other')}" if more > 0 else "")


def curve_table(curve: CurveTable) -> blocks.TableBlock:
    """A free curve: what it is, and its torque at the nodes."""
    caption = f"{effect_title(curve.effect)} on {curve.joint}: not physics"
    caption += f"; its form is that of {curve.form}" if curve.form else ""
    head = [f"{curve.variable} [{curve.unit}]", *(f"{way} ± 95 % [Nm]".strip() for way in curve.directions)]
    rows = [
        [
            number(at),
            *(
                " ± ".join(interval(value[k], std[k]))
                for value, std in zip(curve.value, curve.std, strict=True)
            ),
        ]
        for k, at in enumerate(curve.at)
    ]
    return blocks.table(head, rows, range(len(head)), caption, fold=())


def combination_table(combinations: Sequence[Combination]) -> blocks.TableBlock:
    """Identifiable combinations of inertial parameters."""
    rows = [[c.name, *estimate_cells(c), c.unit, c.identifiable] for c in combinations]
    faint = [k for k, c in enumerate(combinations) if c.identifiable != "yes"]
    head = ("inertial combination", "value", "± 95 %", "unit", "identifiable")
    return blocks.table(head, rows, (1, 2), faint=faint)


def _source(content: Story) -> str:
    """The source of the values, and the meaning of the marks."""
    found = content.identification
    if found is not None and content.measurements.drive is not None:
        groups = f"{plural(len(found.groups), 'group')} ({', '.join(found.groups)})"
        how = f"Identified by the free motion from the goals of {groups}"
    elif found is not None:
        how = f"Identified with the observer {found.observer_name}" + (", refined" if found.refined else "")
        how += f" on {plural(len(found.groups), 'group')} ({', '.join(found.groups)})"
    else:
        how = "Fitted by the diagnosis, as identify does with the same effects"
    return (
        f"{how}. ± is half of a 95 % interval. Motor quantities are expressed at the joint. The data "
        "determine a parameter ● well, ◐ weakly or ○ not at all; a value less than its interval is left out."
    )


def place_of(p: ParameterEstimate) -> str:
    """The joint, payload or group that the parameter belongs to."""
    return ", ".join(part for part in (p.joint, p.payload, p.group) if part) or "all joints"


def _main(found: Sequence[ParameterEstimate]) -> list[blocks.Block]:
    """A row per parameter and a column per joint, in tables of at most `MAX_PLACES` columns."""
    kinds: dict[str, dict[str, ParameterEstimate]] = {}
    for p in found:
        kinds.setdefault(p.name, {})[place_of(p)] = p
    places = list(dict.fromkeys(map(place_of, found)))
    tables: list[blocks.Block] = []
    for first in range(0, len(places), MAX_PLACES):
        shown = places[first : first + MAX_PLACES]
        rows = [_row(name, at, shown) for name, at in kinds.items() if not at.keys().isdisjoint(shown)]
        caption = "" if first else "Parameters of joints and effects, ± 95 %"
        head = ("parameter", *shown)
        tables.append(blocks.table(head, rows, range(1, len(head)), caption, dense=True))
    return tables


def _row(name: str, at: Mapping[str, ParameterEstimate], places: Sequence[str]) -> list[str | blocks.Cell]:
    """Name with unit, and the value at every place; large torques and stiffnesses with the prefix k or M."""
    units = {p.unit for p in at.values()}
    unit = units.pop() if len(units) == 1 else ""  # joints that slide and that turn: each cell has its own
    largest = max(abs(p.value) for p in at.values())
    factor, prefix = next(((f, p) for f, p, least in LARGE if largest >= least), (1.0, ""))
    factor, prefix = (factor, prefix) if unit.startswith("N") else (1.0, "")
    label = f"{plain_name(name)} [{prefix}{unit}]" if unit_text(unit) else plain_name(name)
    cells = [
        ""
        if (p := at.get(place)) is None
        else estimate_mark(p, factor)
        + (f" {unit_text(p.unit)}".rstrip() if units else "")
        + (", at its bound" if p.at_bound else "")
        for place in places
    ]
    return [label, *cells]


def _ties(found: Sequence[ParameterEstimate], joints: Sequence[str]) -> str:
    """Which parameters are correlated; the same two parameters of several joints are named once."""
    pairs: dict[tuple[str, str], dict[str, None]] = {}
    for p in found:
        for tie in p.tied_to[:LISTED]:
            name, _, joint = tie.partition(":")
            own, other = plain_name(p.name), plain_name(name)
            if joint == p.joint and joint in joints:
                one, two = sorted((own, other))
                pairs.setdefault((one, two), {})[joint] = None
            else:
                one, two = sorted((f"{own} of {place_of(p)}", tied(tie)))
                pairs.setdefault((one, two), {})
    texts = [
        f"{one} and {two}" + (f" of {joints_text(list(of), joints)}" if of else "")
        for (one, two), of in pairs.items()
    ]
    more = f"; {len(texts) - MAX_PLACES} more" if len(texts) > MAX_PLACES else ""
    return f"Correlated, so that only a combination is known: {'; '.join(texts[:MAX_PLACES])}{more}."


def tied(name: str) -> str:
    """ "izz:joint1" in words."""
    parameter, _, joint = name.partition(":")
    return plain_name(parameter) + (f" of {joint}" if joint else "")


def _inertias(content: Story, found: Sequence[ParameterEstimate]) -> blocks.Section:
    combinations = content.identification.combinations if content.identification is not None else ()
    matrix = _matrix(content, found)
    if not combinations:
        return blocks.section("Inertias", matrix)
    known = [c for c in combinations if determined(c)]
    only = blocks.explanation(
        f"Motion determines only combinations of the inertial parameters, {len(known)} of "
        f"{len(combinations)} here."
    )
    rows = [[c.name, estimate_mark(c), unit_text(c.unit)] for c in known]
    head = ("combination", "value ± 95 %", "unit")
    title = "Identified combinations of inertial parameters"
    return blocks.section(
        "Inertias", only, blocks.table(head, rows, (1,), title, dense=True) if rows else None, matrix
    )


def _matrix(content: Story, found: Sequence[ParameterEstimate]) -> blocks.TableBlock | None:
    by_place = {(p.joint, p.name): p for p in found}
    rows = []
    for joint in content.joints:
        row = [joint]
        for name in INERTIAL_NAMES:
            p = by_place.get((joint, name))
            row.append("–" if p is None else _inertial_text(p))
        rows.append(row)
    caption = "Inertial parameters in the joint frame [kg, kg m, kg m²]; ○ not determined"
    return blocks.table(("link moved by", *INERTIAL_HEAD), rows, range(1, 11), caption, dense=True)


def _inertial_text(p: ParameterEstimate) -> str:
    return f"{number(p.value, 3)} {MARKS.get(p.identifiable, '')}" if determined(p) else MARKS["no"]
