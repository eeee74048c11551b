"""An effect's explanation card: equation, picture, how it shows, what confirms it."""

from __future__ import annotations

import re
from functools import cache
from xml.etree import ElementTree

from flexviz.effects import EFFECTS
from flexviz.resources import data_dir
from flexviz.wording import bounds_text, enters_text, escape, parameter_text

LARGEST = 60_000  # bytes of a picture


@cache
def picture(name: str) -> str:
    """The effect's picture as SVG, or nothing where there is none; it is shipped with the documents."""
    file = data_dir("docs/effects") / f"{name}.svg"
    if name not in EFFECTS or not file.is_file() or file.stat().st_size > LARGEST:
        return ""
    text = file.read_text(encoding="utf-8")
    try:
        ElementTree.fromstring(text)
    except ElementTree.ParseError:
        return ""
    return re.sub(r' width="480" height="\d+"', ' width="100%"', text, count=1)


def card_html(name: str) -> str:
    """The card of one effect, closed at first."""
    effect = EFFECTS.get(name)
    if effect is None:
        return ""
    rows = "".join(
        f"<tr><td>{escape(parameter_text(p))}</td><td>{escape(bounds_text(p))}</td>"
        f"<td>{escape(p.explanation)}</td></tr>"
        for p in effect.parameters
    )
    return (
        f'<div class="fv"><details class="fv-card"><summary>What is {escape(lower(effect.title))}?</summary>'
        f"<p>{escape(effect.explanation)}</p>"
        f'<pre class="fv-equation">{escape(effect.equation)}</pre>'
        f'<p class="fv-dim">{escape(enters_text(effect))}</p>'
        f'<table class="fv-table fv-left">{rows}</table>'
        f"{picture(name)}"
        f"<p><b>In a residual.</b> {escape(effect.signature)}</p>"
        f"<p><b>What confirms it.</b> {escape(effect.confirm)}</p>"
        f'<p class="fv-dim">{escape(effect.reference)}</p></details></div>'
    )


def lower(title: str) -> str:
    """A title inside a sentence: names of persons keep their capital."""
    names = ("Coulomb", "Stribeck")
    return title if title.startswith(names) else title[:1].lower() + title[1:]
