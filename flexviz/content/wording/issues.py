"""What is wrong or odd with a recording, in words: one function per kind of fault, else `general`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Protocol

from flexviz.base.spelling import listed, number
from flexviz.robot.mounting import gravity_text


class FixLike(Protocol):
    """A change of a mapping."""

    @property
    def key(self) -> str: ...
    @property
    def value(self) -> Any: ...


class IssueLike(Protocol):
    """See `flexviz.checks.Issue`."""

    @property
    def kind(self) -> str: ...
    @property
    def severity(self) -> str: ...
    @property
    def joints(self) -> tuple[str, ...]: ...
    @property
    def signal(self) -> str: ...
    @property
    def values(self) -> Mapping[str, Any]: ...
    @property
    def fixes(self) -> Sequence[FixLike]: ...
    @property
    def remedies(self) -> Sequence[Any]: ...
    @property
    def alike(self) -> Sequence[Any]: ...
    @property
    def slides(self) -> tuple[str, ...]: ...


SAYING: dict[str, Callable[[Any], str]] = {}
MOST_ALIKE = 2  # other causes that are named


def says(*kinds: str) -> Callable[[Callable[[Any], str]], Callable[[Any], str]]:
    """Register what is said of issues of these kinds."""

    def register(function: Callable[[Any], str]) -> Callable[[Any], str]:
        SAYING.update(dict.fromkeys(kinds, function))
        return function

    return register


def issue_text(issue: IssueLike) -> str:
    """An issue with its signal and joints."""
    return f"{issue.signal} of {', '.join(issue.joints)}: {issue_message(issue)}"


def issue_message(issue: IssueLike) -> str:
    """An issue in a sentence."""
    message = SAYING.get(issue.kind, general)(issue)
    if "groups" in issue.values and issue.kind != "payload":
        message = f"in {listed(list(issue.values['groups']))}, {message}"
    message += "".join(f"; or {_other_cause(other, issue)}" for other in issue.alike[:MOST_ALIKE])
    return message + (", which these data do not tell apart" if issue.alike else "")


def percent(share: float) -> str:
    """A share in words."""
    return "nothing" if share <= 0.005 else f"{100 * share:.0f} %"


def keys_text(fixes: Iterable[FixLike]) -> str:
    """`unit = "deg"`; of several joints once."""
    fixes = list(fixes)
    if {fix.key for fix in fixes} == {"sign"} and len({fix.value for fix in fixes}) > 1:
        return "the opposite sign"
    values = (f'"{f.value}"' if isinstance(f.value, str) else f"{f.value:g}" for f in fixes)
    texts = dict.fromkeys(f"{f.key} = {value}" for f, value in zip(fixes, values, strict=True))
    return ", ".join(texts)


def gained(issue: IssueLike) -> str:
    """How much more of the torque is explained."""
    joint = issue.values["joint"]
    whose = "its torque" if issue.joints == (joint,) else f"the torque of {joint}"
    now, before = (percent(issue.values[name]) for name in ("explained", "explained_before"))
    return f"{now} of {whose} instead of {before}"


def reason(issue: IssueLike) -> str:
    """What explains the torques, as in "with …"."""
    values = issue.values
    if issue.kind == "sign" and issue.signal == "theta and tau":
        return "opposite signs of theta and tau"
    if "angle" in values:
        return f"the zero of {issue.joints[0]} moved by {number(values['angle'], 2)} rad"
    if issue.kind == "drift":
        return f"a zero that drifts by up to {number(values['drift'], 2)} {values['unit']}"
    if issue.kind == "zero":
        return f"{keys_text(issue.fixes)} rad"
    if issue.kind == "order":
        order, changed = values["order"], issue.joints
        if len(changed) == 2:
            return f"the columns of {changed[0]} and {changed[1]} exchanged"
        return f"the columns read in the order {', '.join(order)}"
    if issue.kind == "mounting":
        return gravity_text(issue.remedies[0].value)
    if issue.kind == "payload":
        return _payloads(values)
    if issue.kind == "coupling":
        joints = ", ".join(f'"{joint}"' for joint in values["coupled"])
        matrix = f"coupling = {{ joints = [{joints}], matrix = {values['matrix']} }}"
        return f'{matrix} and side = "motor" of {values["signals"]}'
    if issue.kind == "gravity":
        if "motion" in values["lacks"]:
            return "nothing but gravity in it"
        whose = " but the payload's" if "load" not in values["lacks"] else ""
        return f"no gravity{whose} in it" if whose else "no torque of gravity in it"
    if issue.kind == "delay":
        when = "late" if values["delay"] > 0 else "early"
        return f"the torque stamped {1e3 * abs(values['delay']):.2g} ms {when}"
    if "read_as" in values:
        return values["read_as"]
    if issue.kind == "rated":
        return f"{values['share']} of rated torques"
    if issue.kind == "magnitude":
        return "the sign that it lacks"
    if not issue.fixes and issue.kind == "unit":
        return "another unit"
    return keys_text(issue.fixes) or issue.kind.replace("_", " ")


def _payloads(values: Mapping[str, Any]) -> str:
    names = listed(list(values["groups"]))
    if "mass" in values:
        return f"{number(values['mass'], 2)} kg more at the last link in {names}"
    return f"the payloads of {names} exchanged"


def _other_cause(other: IssueLike, told: IssueLike) -> str:
    """What explains the torques as well, in a few words."""
    if other.values.get("converted"):
        return "tau was converted already and only the friction is coupled"
    same = set(other.joints) == set(told.joints) or len(other.joints) == other.values["all_joints"]
    whose = "" if same else f" of {listed(list(other.joints))}"
    return f"{reason(other)} of {other.signal}{whose}" if other.fixes else reason(other)


def general(issue: IssueLike) -> str:
    """What is said of a kind of fault that has no words of its own."""
    if "explained" in issue.values:
        return f"with {reason(issue)} the robot's masses explain {gained(issue)}"
    facts = ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in issue.values.items())
    what = issue.kind.replace("_", " ") + (f" ({facts})" if facts else "")
    keys = "; ".join(map(str, issue.remedies))
    return what + (f". Proposed: {keys}" if keys else "")
