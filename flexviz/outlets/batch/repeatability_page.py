"""What several recordings of one robot have in common, as sentences and as a section of the page."""

from __future__ import annotations

from collections.abc import Sequence

from flexviz.content.wording import effect_text_name, number, percent, plain_name, plural
from flexviz.outlets.batch.repeatability import Repeatability, RepeatedFinding, RepeatedValue
from flexviz.outlets.report import Block, Cell, Section, explanation, section
from flexviz.outlets.report import table as report_table

MOST_LISTED = 6  # findings or values of a sentence
MOST_ROWS = 200  # of a table


def parameter_words(label: str) -> str:
    """ "stiffness, joint1"."""
    name, _, place = label.partition(":")
    return plain_name(name) + (f", {place}" if place else "")


def finding_words(one: RepeatedFinding) -> str:
    """ "Coulomb friction on joint2"."""
    return effect_text_name(one.text, one.family)


def value_words(one: RepeatedValue) -> str:
    """What the recordings say about a value: "repeats", or what does not."""
    if one.count == 1:
        return f"in 1 of {one.of}"
    words = "repeats" if one.holds else f"scatters {number(one.ratio, 2)} × as much as stated"
    return words if one.everywhere else f"{words}, in {one.count} of {one.of}"


def repeatability_lines(of: Repeatability) -> list[str]:
    """Which findings and values come back in all recordings of a robot, and which do not."""
    out = [f"{of.robot}, {plural(of.recordings, 'recording')}:"]
    always = [finding_words(one) for one in of.findings if one.everywhere]
    seldom = [f"{finding_words(one)} ({one.count} of {one.of})" for one in of.findings if not one.everywhere]
    out += [f"  found in all: {_some(always)}"] if always else []
    out += [f"  found in some: {_some(seldom)}"] if seldom else []
    good = [one for one in of.values if one.everywhere and one.holds]
    shown = [f"{parameter_words(one.parameter)} ({percent(one.relative)})" for one in good]
    out += [f"  values that repeat within their intervals, with their spread: {_some(shown)}"] if good else []
    wide = sorted((one for one in of.values if not one.holds), key=lambda one: -one.ratio)
    shown = [
        f"{parameter_words(one.parameter)} (spread {percent(one.relative)}, {number(one.ratio, 2)} × stated)"
        for one in wide
    ]
    out += [f"  values that scatter more than their intervals: {_some(shown)}"] if wide else []
    rare = [
        f"{parameter_words(one.parameter)} ({one.count} of {one.of})"
        for one in of.values
        if not one.everywhere
    ]
    return out + ([f"  values in some only: {_some(rare)}"] if rare else [])


def _some(texts: Sequence[str]) -> str:
    more = len(texts) - MOST_LISTED
    return "; ".join([*texts[:MOST_LISTED], *([f"{more} more"] if more > 0 else [])]) or "–"


def repeatability_section(robots: Sequence[Repeatability]) -> Section | None:
    """A part per robot with its findings and values; None where no robot has enough recordings."""
    if not robots:
        return None
    about = explanation(
        "What the recordings of one robot have in common. An effect counts where the diagnosis added it. The "
        "spread of a value is its standard deviation between the recordings; it is compared with the stated "
        "standard errors by χ², with 1 % false alarms per robot. A value that scatters more depends on "
        "something that changes between the recordings, or the model lacks an effect that it stands in for: "
        "expect the next recording within its spread, not within its interval."
    )
    return section("Repeatability", about, parts=[_part(one) for one in robots])


def _part(of: Repeatability) -> Section:
    blocks: list[Block] = []
    if of.findings:
        rows = [
            (
                finding_words(one),
                Cell(f"{one.count} of {one.of}", strong=not one.everywhere),
                _some(one.absent),
            )
            for one in of.findings[:MOST_ROWS]
        ]
        blocks.append(report_table(("effect", "found in", "not in"), rows, caption="Findings"))
    else:
        blocks.append(explanation("No effect was added to any recording."))
    body = [
        [
            parameter_words(one.parameter),
            number(one.mean),
            one.unit,
            percent(one.relative),
            number(one.spread, 2),
            number(one.stated, 2),
            number(one.ratio, 2),
            Cell(value_words(one), strong=not (one.everywhere and one.holds)),
        ]
        for one in of.values[:MOST_ROWS]
    ]
    head = ("parameter", "mean", "unit", "spread", "spread [unit]", "stated [unit]", "spread ÷ stated", "")
    blocks.append(report_table(head, body, numbers=(1, 3, 4, 5, 6), caption="Values", dense=True))
    return section(f"{of.robot}: {plural(of.recordings, 'recording')}", *blocks)
