"""The form for one's own robot: table of columns, runs, doubts and refused files (HTML)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress

from flexviz.base.arrays import Array
from flexviz.base.errors import InputError
from flexviz.checks import Issue
from flexviz.content.charts import COLOURS
from flexviz.content.wording import escape, issue_text, listed, number, plural
from flexviz.data.importing import ColumnPreview, Draft, LogPreview, Proposal
from flexviz.data.importing import Mapping as LogMapping

OWN_SIGNALS = {"theta": "θ", "tau": "τ", "q": "q", "tau_joint": "joint torque", "theta_ref": "ref"}
GOAL = "goal"  # a reference that drives the joints
WIDTH, HEIGHT = 84, 30  # [px] of a small plot
KEYS = {"unit": "unit", "side": "side", "sign": "sign", "offset": "offset"}
Scales = Mapping[tuple[str, str], float]  # (joint, signal) -> one unit of its column in SI at the joint


def trace_svg(values: Array) -> str:
    """A line without axes, scaled to its smallest and largest value."""
    low, high = float(values.min()), float(values.max())
    across = max(len(values) - 1, 1)
    points = " ".join(
        f"{WIDTH * i / across:.1f},{2 + (HEIGHT - 4) * (high - float(y)) / max(high - low, 1e-300):.1f}"
        for i, y in enumerate(values)
    )
    line = f'<polyline points="{points}" fill="none" stroke="{COLOURS.measured}" stroke-width="1.2"/>'
    size = f'width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}"'
    return f'<svg {size} aria-hidden="true">{line}</svg>'


def scales_of(mapping: LogMapping) -> dict[tuple[str, str], float]:
    """One unit of every signal's column in SI at the joint side."""
    return {(joint, name): mapping.joints[joint].scale(signal) for joint, name, signal in mapping.signals()}


def shown_signals(draft: Draft) -> dict[str, str]:
    """Signal -> symbol of the rows: θ, τ or its goal, and what else a joint has a column of."""
    present = {name for joint in draft.joints.values() for name in joint.signals}
    shown = {*present, *draft.needed}
    symbols = OWN_SIGNALS | ({"theta_ref": GOAL} if draft.drive else {})
    return {name: symbol for name, symbol in symbols.items() if name in shown}


def own_columns_html(
    draft: Draft, log: LogPreview, scales: Scales, issues: Sequence[Issue], prismatic: Sequence[str] = ()
) -> str:
    """Table: a row per joint and signal with its plot, column, unit, side, sign and range, doubts below it.

    Args:
        scales: of the signals whose conversion is known.
        prismatic: the joints that slide.
    """
    rows = []
    for joint, entry in draft.joints.items():
        rows.append(f'<tr class="fv-group"><td colspan="3">{escape(joint)}{_constants(entry)}</td></tr>')
        for name, symbol in shown_signals(draft).items():
            row = f'<td>{symbol}</td><td colspan="2" class="fv-doubt">no column</td>'
            if (signal := entry.signals.get(name)) is not None:
                unit = _si(name, joint in prismatic)
                shown = log.columns.get(signal["from"])
                plot = trace_svg(shown.values) if shown else ""
                text = _signal_text(signal, shown, unit, scales.get((joint, name)))
                row = f"<td>{symbol}</td><td>{plot}</td><td>{text}</td>"
            rows.append(f'<tr data-own="{escape(f"{symbol} of {joint}")}">{row}</tr>')
            rows += [
                f'<tr><td></td><td colspan="2" class="fv-doubt">{escape(_doubt(issue))}</td></tr>'
                for issue in issues
                if issue.joints[:1] == (joint,) and _first(issue) == name
            ]
    return (
        f'<div class="fv"><table class="fv-table fv-left fv-own"><col><col><col>{"".join(rows)}</table></div>'
    )


def _signal_text(
    signal: Mapping[str, object], shown: ColumnPreview | None, unit: str, scale: float | None
) -> str:
    """Column, conversion and range of a signal."""
    own = signal.get("unit", unit)
    said = f"× {own:g} {unit}" if isinstance(own, float | int) else str(own)
    side = ", before the gear" if signal.get("side") == "motor" else ""
    sign = ", sign reversed" if signal.get("sign") == -1 else ""
    lines = [f"<b>{escape(signal['from'])}</b>", escape(f"{said}{side}{sign}")]
    if shown is not None:
        before = f"{number(shown.low, 3)} … {number(shown.high, 3)}"
        lines.append(f'<span class="fv-dim">{before}{_converted(shown, unit, scale)}</span>')
    return "<br>".join(lines)


def _converted(shown: ColumnPreview, unit: str, scale: float | None) -> str:
    if scale in (None, 1.0):
        return f" {unit}" if scale else ""
    low, high = sorted((shown.low * scale, shown.high * scale))
    return f" → {number(low, 3)} … {number(high, 3)} {unit}"


def _constants(entry: object) -> str:
    """Gear and torque constant of a joint, where they are stated."""
    gear, constant = getattr(entry, "gear", 1.0), getattr(entry, "torque_constant", None)
    said = [f"gear {gear:g}"] if gear != 1.0 else []
    said += [f"{constant:g} Nm/A"] if constant is not None else []
    return f' <span class="fv-dim">{", ".join(said)}</span>' if said else ""


def _si(name: str, slides: bool) -> str:
    return (("Nm", "N") if name in ("tau", "tau_joint") else ("rad", "m"))[slides]


def _first(issue: Issue) -> str:
    """The row an issue stands at: that of its first signal."""
    return issue.signal.split(" and ")[0]


def _doubt(issue: Issue) -> str:
    start = "Wrong" if issue.severity == "wrong" else "Odd"
    return f"{start}: {issue_text(issue)}"


def remedy_text(remedies: Sequence[Proposal]) -> str:
    """What a button that sets these keys says: "θ of joint1, joint2: unit deg", "gravity = [9.81, 0, 0]"."""
    changes: dict[tuple[str, str], list[str]] = {}
    others = []
    for one in remedies:
        if one.place[:1] != ("joints",):
            others.append(str(one))
            continue
        _, joint, signal = one.place
        joints = changes.setdefault((OWN_SIGNALS.get(signal, signal), _change_text(one)), [])
        joints += [] if joint in joints else [joint]
    texts = [f"{symbol} of {', '.join(joints)}: {what}" for (symbol, what), joints in changes.items()]
    return "; ".join([*texts, *others])


def _change_text(one: Proposal) -> str:
    if one.key == "side":
        return "before the gear" if one.value == "motor" else "behind the gear"
    if one.key == "sign":
        return "sign +" if one.value == 1 else "sign −"
    if isinstance(one.value, bool):
        return one.text
    value = number(float(one.value)) if isinstance(one.value, float) else one.value
    return f"{KEYS.get(one.key, one.key)} {value}"


def own_files_html(
    robot: str,
    joints: int,
    logs: Sequence[str],
    refused: Mapping[str, str],
    where: str,
    notes: Sequence[str] = (),
) -> str:
    """The files in use, those that are not with the reason, `where` all of them stay, `notes` of reading."""
    used = f"<b>{escape(robot)}</b>: {plural(joints, 'joint')}. Logs: {escape(listed(list(logs)))}."
    rows = "".join(
        f'<div class="fv-doubt">Not used: <b>{escape(name)}</b>: {escape(why)}</div>'
        for name, why in refused.items()
    )
    said = "".join(f'<div class="fv-dim">• {escape(note)}</div>' for note in notes)
    return f'<div class="fv">{used} <span class="fv-dim">{escape(where)}</span>{rows}{said}</div>'


def own_runs_html(draft: Draft) -> str:
    """Table of the runs: group, files, use and payload."""
    head = "<tr><th>group</th><th>log</th><th>use</th><th>payload</th></tr>"
    rows = "".join(
        f"<tr><td>{escape(group)}</td><td>{escape(', '.join(path.name for path in source.paths))}</td>"
        f"<td>{'validate' if group in draft.validation else 'fit'}</td>"
        f"<td>{escape(draft.loads.get(group, 'none'))}</td></tr>"
        for source, group in zip(draft.sources, draft.groups, strict=True)
    )
    return f'<div class="fv"><table class="fv-table fv-left fv-runs">{head}{rows}</table></div>'


def own_state_html(
    missing: Sequence[str], issues: Sequence[Issue], checked: bool, goals: bool = False
) -> str:
    """What keeps the set from being opened, in a few words; `goals` drive the joints."""
    if missing:
        items = "".join(f"<div>• {escape(text)}</div>" for text in missing)
        return f'<div class="fv fv-doubt"><b>Still to be stated:</b>{items}</div>'
    wrong = sum(issue.severity == "wrong" for issue in issues)
    odd = [escape(issue_text(issue)) for issue in issues if issue.severity == "odd"]
    if not checked:
        return '<div class="fv fv-dim">Changed since the last check; Open checks it again.</div>'
    if wrong:
        text = f"The data contradict {plural(wrong, 'entry')}: press a remedy, or correct the entry."
        return f'<div class="fv fv-doubt"><b>{text}</b></div>'
    if odd:
        return '<div class="fv fv-warn">Checked: nothing is wrong, but see what looks odd above.</div>'
    good = "the robot's masses do not contradict these columns"
    good = "the joints follow these goals" if goals else good
    return f'<div class="fv fv-dim">Checked: {good}.</div>'


def known_scales(draft: Draft) -> dict[tuple[str, str], float]:
    """`scales_of` a draft, empty while it is incomplete."""
    with suppress(InputError):
        return scales_of(draft.mapping())
    return {}
