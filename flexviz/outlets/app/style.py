"""Style sheet of the app's HTML, light and dark, corrections of viser's controls, and tooltips of buttons."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import Any

from flexviz.outlets.app.viser_private import (
    BACKGROUND,
    DARK,
    NUMBER_BOX,
    PLOT,
    SCROLLED,
    SLIDER_VALUE,
    THEME,
    button,
    button_box,
    control,
    control_box,
    id_of,
)

TOOLTIP_DELAY = 0.5  # [s] as viser's own

CSS = """
.fv { font-size: 13px; line-height: 1.45; padding: 0 0.75em 0.45em; color: var(--fv-text); }
.fv-dim { color: var(--fv-dimmed); }
.fv-tag { background: #56B4E9; color: #000; border-radius: 3px; padding: 0 0.4em; font-size: 11px; }
.fv-warn { border-left: 3px solid #E69F00; padding-left: 0.5em; margin-top: 0.3em; overflow-wrap: anywhere; }
.fv-steps { padding-top: 0.6em; font-size: 12px; word-spacing: -0.06em; }
.fv-steps span, .fv-status span { white-space: nowrap; }
.fv-steps .fv-now { font-weight: 700; border-bottom: 2px solid #0072B2; }
.fv-status { margin: 0 0.75em 0.5em; padding: 0.35em 0.6em; border-left: 3px solid #009E73;
  background: rgba(128, 128, 128, 0.12); overflow-wrap: anywhere; }
.fv-status.busy { border-color: #0072B2; }
.fv-status.bad { border-color: #D55E00; } .fv-status.warn { border-color: #E69F00; }
.fv.fv-warn { margin: 0.2em 0.75em 0.5em; padding: 0 0 0 0.5em; }
.fv-table { border-collapse: collapse; width: 100%; font-size: 12px; font-variant-numeric: tabular-nums; }
.fv-table th { font-weight: 500; color: var(--fv-dimmed); text-align: right; padding: 1px 3px; }
.fv-table td { text-align: right; padding: 1px 3px; white-space: nowrap; }
.fv-table td:first-child, .fv-table th:first-child { text-align: left; padding-left: 0;
  white-space: normal; overflow-wrap: anywhere; min-width: 4.5em; }
.fv-left td { text-align: left; white-space: normal; }
.fv-group td { font-weight: 600; border-top: 1px solid rgba(128, 128, 128, 0.35); padding-top: 3px; }
.fv-tied td { color: var(--fv-dimmed); white-space: normal; font-size: 11px; }
.fv-truth { font-style: italic; }
.fv details { margin-top: 0.4em; } .fv summary { cursor: pointer; }
.fv-box { display: inline-block; width: 0.8em; height: 0.8em; border-radius: 2px; margin-right: 0.3em;
  border: 1px solid rgba(128, 128, 128, 0.6); vertical-align: -0.05em; }
.fv-ghost { opacity: 0.55; } .fv-name { white-space: nowrap; margin-right: 0.6em; }
.fv-map { display: inline-block; width: 5em; height: 0.7em; vertical-align: -0.05em; border-radius: 2px; }
.fv-kind { padding-top: 0.35em; padding-bottom: 0.1em; font-weight: 600; }
.fv-joints td:first-child { white-space: nowrap; }
.fv-joints .fv-dim { font-size: 11px; }
.fv-tuned { min-height: 6.25em; /* four lines: what is dragged stays when the text grows */ }
.fv-next { padding-top: 0; }
.fv-wrong { font-size: 17px; line-height: 1.35; padding-bottom: 0.5em; font-weight: 600; }
.fv-verdict { margin: 0.1em 0 0.5em; padding: 0.45em 0.6em; border-radius: 4px; font-weight: 600;
  border: 1px solid #999; border-left-width: 4px; }
.fv-verdict.missing { border-color: #D55E00; } .fv-verdict.unknown { border-color: #E69F00; }
.fv-verdict.nothing-missing { border-color: #009E73; }
.fv-rises { font-weight: 600; white-space: nowrap; }
.fv-old { font-weight: 400; } .fv-old s { color: var(--fv-dimmed); }
.fv-so-far { margin: 0.1em 0.75em 0.5em; padding: 0.45em 0.6em; border-radius: 4px; border: 1px dashed #999; }
div:has(> .fv-added) { display: inline-block; width: 66%; vertical-align: top; }
.fv-hatched { background: repeating-linear-gradient(135deg, #8886 0 1px, transparent 1px 6px); }
.fv-added { padding-top: 0.3em; padding-right: 0.2em; }
.fv-finding { margin-top: 0.2em; padding-top: 0.4em; border-top: 1px solid rgba(128, 128, 128, 0.3); }
.fv-bar { height: 5px; border-radius: 3px; background: rgba(128, 128, 128, 0.25); margin: 2px 0; }
.fv-bar span { display: block; height: 100%; border-radius: 3px; background: #999; }
.fv-stair { position: relative; padding: 1px 0 6px; }
.fv-stair span { display: block; min-width: 2px; height: 9px; border-radius: 0 2px 2px 0; }
.fv-stair .fit { height: 5px; margin-bottom: 1px; }
.fv-stair.hatched span { background-image:
  repeating-linear-gradient(135deg, #fffc 0 3px, transparent 3px 7px); }
.fv-stair i { position: absolute; top: 0; bottom: 3px; border-left: 2px dotted var(--fv-text); }
.held { background: #009E73; } .fit { background: #0072B2; }
.fv-stair-key span { display: inline-block; width: 1.6em; height: 0.7em; margin-left: 0.5em; }
.fv-bar.fv-likely span { background: #0072B2; }
.fv-card summary { color: #0072B2; } @dark .fv-card summary { color: #56B4E9; }
.fv-card p { margin: 0.4em 0; } .fv-card svg { max-width: 100%; height: auto; }
.fv-equation { font-size: 12.5px; margin: 0.3em 0; padding: 0.4em 0.6em; border-radius: 3px;
  white-space: pre-wrap; background: rgba(128, 128, 128, 0.12); }
.fv-multiples { display: grid; grid-template-columns: 1fr 1fr; gap: 0.3em 0.5em; }
.fv-multiple { padding: 0.15em 0.3em; border: 1px solid rgba(128, 128, 128, 0.35); border-radius: 3px;
  font-size: 11px; line-height: 1.3; min-width: 0; font-variant-numeric: tabular-nums; }
.fv-multiple.fv-chosen { border-color: #0072B2; box-shadow: inset 0 0 0 1px #0072B2; }
.fv-multiple div { display: flex; justify-content: space-between; gap: 0.4em; white-space: nowrap; }
.fv-multiple span { overflow: hidden; text-overflow: ellipsis; }
.fv-multiple svg { display: block; width: 100%; height: 36px; }
.fv-poles { display: block; width: 100%; touch-action: none; }
.fv-poles [data-pole] { cursor: grab; }
.fv-bad { color: #C92A2A; } @dark .fv-bad { color: #FF8787; }
.fv-tip, .fv-term.fv-first { cursor: help; text-decoration: underline dotted; text-underline-offset: 2px; }
.fv-term { text-decoration: none; }
.fv-term:focus-visible { outline: 2px solid #0072B2; outline-offset: 1px; }
.fv-status b { font-weight: 600; }
.fv-alone td:first-child { max-width: 10.5em; overflow: hidden; text-overflow: ellipsis; white-space: nowrap;
  text-align: left; }
.fv-alone td, .fv-alone th { padding-left: 2px; padding-right: 2px; }
.fv-tall th { writing-mode: vertical-rl; }
.fv-heat td { text-align: center; } .fv-heat th { text-align: center; }
@dark .fv-heat td[style] { color: #fff; }
.fv-fleet { max-height: 36vh; overflow-y: auto; margin-top: 0.3em; }
.fv-fleet tr[data-fleet] { cursor: pointer; }
.fv-fleet tr[data-fleet]:hover { background: rgba(86, 180, 233, 0.25); }
.fv-fleet .fv-table th { text-align: left; }
.fv-fleet .fv-table td:first-child, .fv-fleet .fv-table th:first-child { min-width: 2.2em; }
.fv-fleet .fv-table td:nth-child(3), .fv-fleet .fv-table td:last-child { white-space: nowrap; }
.fv-fleet .fv-chosen td { background: rgba(128, 128, 128, 0.18); }
.fv-fleet .fv-open td:first-child { border-left: 3px solid #0072B2; padding-left: 3px; }
.uplot .u-legend { white-space: normal; }
.uplot .u-series.fv-edge { display: none; }
.fv-chosen td { font-weight: 700; border-bottom: 2px solid #0072B2; }
.fv-doubt, .fv-rises, .fv-no { color: #B34700; } .fv-weak { color: #855A00; } .fv-yes { color: #00755A; }
@dark :is(.fv-doubt, .fv-rises, .fv-no) { color: #FF8A4C; }
@dark .fv-weak { color: #E69F00; }
@dark .fv-yes { color: #3CC8A0; }
.fv-runs th { text-align: left; }
.fv-own { table-layout: fixed; } .fv-own td { vertical-align: top; overflow-wrap: anywhere; }
.fv-own col:nth-child(1) { width: 30px; } .fv-own col:nth-child(2) { width: 90px; }
.fv-own tr[data-own] { cursor: pointer; } .fv-own tr[data-own]:hover { background: rgba(86, 180, 233, 0.25); }
.fv-own svg { display: block; background: rgba(128, 128, 128, 0.1); border-radius: 2px; }
@dark .fv-own polyline { stroke: #56B4E9; }
.fv-drop { position: fixed; inset: 12px; z-index: 500; display: flex; flex-direction: column; gap: 0.4em;
  align-items: center; justify-content: center; border: 3px dashed #0072B2; border-radius: 12px;
  background: rgba(255, 255, 255, 0.88); color: #212529; font-size: 20px; pointer-events: none; }
.fv-drop small { font-size: 14px; } .fv-dark .fv-drop { background: rgba(33, 37, 41, 0.9); color: #fff; }
.fv-png { position: absolute; top: 8px; left: 8px; padding: 0 5px; font-size: 10.5px; cursor: pointer;
  border: 1px solid rgba(128, 128, 128, 0.5); border-radius: 3px; background: none; color: inherit;
  opacity: 0; } @plot:hover .fv-png, .fv-png:focus { opacity: 1; }
.fv-arc { display: inline-block; width: 0.9em; height: 0.45em; border: 2px solid; border-bottom: none;
  border-radius: 0.9em 0.9em 0 0; }
.fv-hover { position: fixed; z-index: 60; padding: 0.25em 0.6em; border-radius: 4px; font-size: 12px;
  background: #212529; color: #fff; pointer-events: none; white-space: nowrap; }
.fv-told { max-width: 300px; white-space: normal; line-height: 1.4; z-index: 600; font-size: 12.5px; }
@scrolled { padding-right: 5px; }
@background { background: linear-gradient(#dfe4ea, #ffffff 70%) !important; }
@dark @background { background: linear-gradient(#59626d, #30363d 70%) !important; }
"""
for name, selector in (("dark", DARK), ("plot", PLOT), ("scrolled", SCROLLED), ("background", BACKGROUND)):
    CSS = CSS.replace(f"@{name}", selector)
CSS = THEME + CSS


EDGE, GAP = 10, 6  # [pixels] beside a row of buttons, between them


def no_label(uuid: str) -> str:
    """A rule that gives a control the whole width."""
    return f"{control(uuid)} > div:first-child {{ display: none; }}"


def hidden(uuid: str) -> str:
    """A rule that hides a control, for the page's own script."""
    return f"{control(uuid)} {{ display: none; }}"


def hidden_button(uuid: str) -> str:
    """A rule that hides a button, for the page's own script."""
    return f"{button_box(uuid)} {{ display: none; }}"


def hidden_in_the_dark(uuid: str) -> str:
    """A rule that hides a control on pages whose address asks for the dark theme."""
    return f".fv-dark {hidden(uuid)}"


def no_number_box(uuid: str) -> str:
    """A rule that hides the numbers at a slider whose scale is not the slider's own number."""
    return f"{control(uuid)} :is({NUMBER_BOX}, {SLIDER_VALUE}) {{ display: none; }}"


def half(uuid: str, label: str = "5.4em") -> str:
    """Rules that put a control into half the panel's width, two in a row, with a short label."""
    box = f"{control_box(uuid)} {{ display: inline-block; width: 50%; vertical-align: top; }}"
    return f"{box}\n{label_width(uuid, label)}"


def label_width(uuid: str, width: str) -> str:
    """A rule that gives a control's label this width."""
    return f"{control(uuid)} > div:first-child {{ width: {width} !important; }}"


def wide_label(uuid: str) -> str:
    """Rules for a wide label and closely spaced rows."""
    return (
        label_width(uuid, "14em") + "\n"
        f"{control(uuid)} {{ padding-bottom: 0 !important; margin-bottom: -0.15em; }}"
    )


def in_row(*uuids: str, share: float | None = None) -> str:
    """Rules that place buttons side by side; each takes `share` of the row (None: equal shares)."""
    width = share if share is not None else 1.0 / len(uuids)
    first = uuids[0]
    boxes, buttons = (", ".join(map(selector, uuids)) for selector in (button_box, button))
    return (
        f"{boxes} {{ display: inline-block; width: calc({width:.4f} * (100% - {2 * EDGE - GAP}px)); "
        f"margin: 0 !important; padding: 0 {GAP}px 0.5em 0; vertical-align: top; }}\n"
        f"{button_box(first)} {{ margin-left: {EDGE if share is None else 0}px !important; }}\n"
        f"{buttons} {{ padding: 0 4px; font-size: 12.5px; }}"
    )


def next_button(uuid: str) -> str:
    """A rule that marks a button as the recommended next action."""
    return f"{button(uuid)} {{ outline: 3px solid #E69F00; outline-offset: 1px; }}"


def next_option(uuid: str, index: int) -> str:
    """The same for button `index` of a button group."""
    return option(uuid, index, "outline: 2px solid #E69F00; outline-offset: -2px; font-weight: 700;")


def pressed(uuid: str, index: int) -> str:
    """A rule that shows button `index` of a button group as the chosen one."""
    return option(uuid, index, "background: #0072B2; color: #fff; border-color: #0072B2;")


def option(uuid: str, index: int, look: str) -> str:
    return f"{control(uuid)} button:nth-of-type({index + 1}) {{ {look} }}"


def style(*rules: str) -> str:
    return "<style>" + "\n".join(rules) + "</style>"


class Tooltips:
    """Tooltips of buttons, drawn by the style sheet, because viser has none for buttons."""

    def __init__(self) -> None:
        self._buttons: list[Any] = []
        self._right: set[str] = set()

    def add(self, button: Any) -> None:
        """Show this button's hint, also while it is disabled."""
        self._buttons.append(button)

    def open_left(self, uuids: Iterable[str]) -> None:
        """Open the hints of these buttons to the left."""
        self._right |= set(uuids)

    def rules(self) -> list[str]:
        """CSS rules for the present hints."""
        shown = [one for one in self._buttons if one.hint and one.visible]
        if not shown:
            return []
        boxes = [button_box(id_of(one)) for one in shown]
        hovered = ", ".join(f"{box}:hover::after" for box in boxes)
        common = (
            "position: absolute; top: calc(100% - 2px); z-index: 50; width: max-content; max-width: 15rem; "
            "padding: 0.35em 0.6em; border-radius: 4px; background: #212529; color: #fff; font-size: 12px; "
            f"line-height: 1.4; pointer-events: none; animation: fv-appear 0.1s {TOOLTIP_DELAY}s both;"
        )
        own = [  # not after a press: what it does may appear beneath
            f":root:not(.fv-pressed) {box}:hover::after {{ content: {css_text(one.hint)}; "
            f"{'right' if id_of(one) in self._right else 'left'}: 6px; }}"
            for box, one in zip(boxes, shown, strict=True)
        ]
        return [
            "@keyframes fv-appear { from { opacity: 0; } to { opacity: 1; } }",
            f"{', '.join(boxes)} {{ position: relative; }}",
            f"{hovered} {{ {common} }}",
            *own,
        ]


@lru_cache(maxsize=256)
def css_text(text: str) -> str:
    """A text as a CSS string that is safe in HTML."""
    escaped = "".join(
        f"\\{ord(character):x} " if character in "\"'\\<>&\n\r" else character for character in text
    )
    return f'"{escaped}"'
