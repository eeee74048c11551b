"""The files of docs/effects as text: one page and one picture an effect, and the index."""

from __future__ import annotations

import textwrap
from pathlib import Path

from benchmarks.effect_pages.pictures import caption, draw
from flexviz.content.wording import (
    SCOPES,
    bounds_text,
    enters_text,
    parameter_text,
    relation_text,
    simulated_text,
)
from flexviz.model.effects import EFFECTS, SIGN_VELOCITY, Effect

FOLDER = Path(__file__).resolve().parent.parent.parent / "docs" / "effects"
LAWS = FOLDER.parent / "images" / "laws"  # by `python -m benchmarks.law_page`
NOTE = (
    "<!-- made from the classes in flexviz/model/effects by `python -m benchmarks.effect_pages --write` -->"
)
WIDTH = 110
INDEX = f"""\
What a joint may have apart from stiffness K, motor inertia B and viscous friction on both sides (f_mv, f_lv).
Every quantity of the motor is expressed at the joint: θ is the motor's angle, q the link's, δ = θ − q, and

    s = τ − Bθ̈ − f_mv θ̇        transmission torque
    q = θ − s/K                  link side
    r = s − Y Γ − f_lv q̇ → 0    residual

An effect's u enters in one of three places, which its page names. sign(v) is taken as
tanh(v / {SIGN_VELOCITY:g} rad/s). `flexviz effects` lists the same in a terminal, `--json FILE` for a
program. What is not here can be added: [user-defined effects](../user-effects.md).
"""

LAW = """\
The law through the data of a simulated set: residual plus the effect's own contribution, averaged; the law
with the band of ± 95 %. A wrong effect's data leave such a band.
"""


def files() -> dict[str, str]:
    """Name in docs/effects → content."""
    out = {"README.md": index()}
    for name, effect in EFFECTS.items():
        out[f"{name}.md"] = page(effect)
        out[f"{name}.svg"] = draw(name)
    return out


def index() -> str:
    """All effects in one table."""
    lines = ["# Effects", "", NOTE, "", INDEX]
    lines += ["| effect | where | what it is | parameters |", "|---|---|---|---|"]
    for effect in EFFECTS.values():
        link = f"[{effect.title}]({effect.name}.md)<br>`{effect.name}`"
        parameters = ", ".join(parameter_text(p) for p in effect.parameters)
        lines.append(_row(link, effect.where, effect.explanation, parameters))
    return "\n".join(lines) + "\n"


def page(effect: Effect) -> str:
    """One effect."""
    name = effect.name
    blocks = [
        f"# {effect.title}",
        NOTE,
        f"`{name}` · {effect.where} · belongs to {SCOPES[effect.scope]}",
        _wrapped(effect.explanation),
        f"    {effect.equation}",
        _wrapped(f"{enters_text(effect)}. {relation_text(effect)}".strip()),
        _parameters(effect),
        f"![{effect.title}: u along a motion]({name}.svg)",
        _wrapped(caption(name)),
        *_law(effect),
        _wrapped(f"**In a residual.** {effect.signature}"),
        _wrapped(f"**In the simulator.** {simulated_text(effect)}"),
        _wrapped(f"**What confirms it.** {effect.confirm}"),
        _wrapped(f"**Reference.** {effect.reference}."),
        "[All effects](README.md)",
    ]
    return "\n\n".join(blocks) + "\n"


def _law(effect: Effect) -> list[str]:
    """The law through the data of a simulated set; nothing of an effect for which there is no picture yet."""
    if not (LAWS / f"{effect.name}.svg").is_file():
        return []
    picture = f"![{effect.title} through simulated data](../images/{LAWS.name}/{effect.name}.svg)"
    return [picture, _wrapped(LAW)]


def _parameters(effect: Effect) -> str:
    lines = ["| | parameter | unit | bounds | |", "|---|---|---|---|---|"]
    lines += [_row(p.symbol, f"`{p.name}`", p.unit, bounds_text(p), p.explanation) for p in effect.parameters]
    return "\n".join(lines)


def _row(*cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _wrapped(text: str) -> str:
    return textwrap.fill(text, WIDTH, break_on_hyphens=False, break_long_words=False)
