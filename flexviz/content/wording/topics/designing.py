"""Designs: what to record, and what that is expected to show."""

from __future__ import annotations

from flexviz.base.facts import Fact
from flexviz.base.spelling import listed, number, plural
from flexviz.content.wording.errors import percent
from flexviz.content.wording.facts import says
from flexviz.content.wording.findings import effect_text_name
from flexviz.content.wording.numbers import interval, unit_text

CRITERIA = {
    "errors": "root mean square of the relative standard errors",
    "volume": "geometric mean of the relative standard errors",
    "separation": "expected gain in log likelihood of the right effect over the wrong one",
}
IN_SET = """In measurements.toml:
  [[groups]]
  name = "pushes"
  trajectory = "pushes"
  payload = "…"
  file = "pushes.csv"
  kind = "holds"
  clamped = """


@says("design-criterion")
def criterion(fact: Fact) -> str:
    """What a design minimises or maximises."""
    return CRITERIA[fact.values["of"]]


@says("design-plan")
def plan(fact: Fact) -> str:
    """Groups to record, what they use of the limits, and how good they are: several lines."""
    values, groups = fact.values, fact.values["recorded"]
    lines = [f"{values['subject']}: {plural(len(groups), 'group')}, seed {values['seed']}"]
    for name, payload, duration, used in groups:
        lines.append(f"  {name}: payload {payload}, {duration:g} s; uses {used}")
    if values["beside"]:
        lines.append(f"  together with the recorded groups {', '.join(values['beside'])}")
    unit = f" {values['unit']}" if values["unit"] else ""
    random = f"a random motion within the limits {values['before']:.3g}{unit}"
    lines += ["", f"{CRITERIA[values['criterion']]}: {values['value']:.3g}{unit}, of {random}"]
    if values["separates"]:
        first, second = map(effect_text_name, values["separates"])
        for true, false, gain in ((first, second, values["gains"][0]), (second, first, values["gains"][1])):
            lines.append(
                f"  if {true} is the true one, it is expected to win over {false} by {gain:.3g} in log "
                "likelihood"
            )
    if values["recorded_gains"]:
        known = " and ".join(f"{gain:.3g}" for gain in values["recorded_gains"])
        lines.append(f"  with the recorded groups alone: {known}")
    return "\n".join(lines)


@says("design-expected")
def expected(fact: Fact) -> str:
    """The errors that a design is expected to leave: several lines."""
    rows = []
    for label, value, std, unit in fact.values["errors"]:
        shown, width = interval(value, std)
        rows.append((label, shown.replace("−", "-"), f"± {width}", unit_text(unit)))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)] if rows else []
    lines = ["Expected of identify --refine with these groups alone (± 95 %):"]
    lines += ["  " + "  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
    if hidden := fact.values["hidden"]:
        lines.append(f"({hidden} parameters that these motions do not show are left out)")
    if fact.values["stopped"]:
        lines.append("stopped early: the best groups so far")
    return "\n".join(lines)


@says("static-test")
def static_test(fact: Fact) -> str:
    """What to do in a static test, and what it is expected to show: several lines."""
    values, everything = fact.values, fact.joints
    joints, others = everything[: values["clamped"]], everything[values["clamped"] :]
    pose = ", ".join(f"{value:.3f}" for value in values["pose"])
    what = f"the link behind {joints[-1]}" if others else "the flange"
    named = ", ".join(f'"{joint}"' for joint in joints)
    lines = [
        f"{values['subject']}: static test, motor side only",
        "",
        f"Clamp {what} at {pose} rad, to something stiffer than the joints.",
        f"It bears up to {number(values['force'], 3)} N and {number(values['moment'], 3)} Nm.",
        f"Then push, one joint after the other, in {values['levels']} steps up and down, "
        f"{plural(values['passes'], 'time')} ({values['holds']} holds of 1 s each, reached without swinging "
        "back); pushes.csv has the torques.",
        "",
        "Expected (± 95 %):",
    ]
    for joint, push, error in zip(joints, values["pushes"], values["errors"], strict=True):
        lines.append(f"  {joint}  pushes up to {number(push, 3)} Nm  stiffness ± {percent(error)}")
    if others:
        lines.append(
            f"  {listed(others)}: behind the clamp; clamp the flange for them, with the others braked"
        )
    return "\n".join([*lines, "", *_hanging(fact), "", IN_SET + (f"[{named}]" if others else "true")])


def _hanging(fact: Fact) -> list[str]:
    """What a hanging weight shows at best."""
    values = fact.values
    hung = dict(zip(fact.joints, values["hung"], strict=True))
    shown = ", ".join(
        f"{joint} ± {percent(error) if error < 1 else 'more than 100 %'}" for joint, error in hung.items()
    )
    enough = [joint for joint, error in hung.items() if error < values["wanted"]]
    return [
        f"Hanging {values['payload']} at the {values['poses']} poses of poses.csv instead, each reached from "
        f"both sides, gives at best, with all masses known: {shown}.",
        f"That is enough for {listed(enough)}."
        if enough
        else "That is not enough for any joint: clamp the flange.",
    ]
