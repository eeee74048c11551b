"""Effects of one kind on several joints as one finding with a value per joint."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from flexviz.wording.findings import FindingLike, effect_text_name, effect_title, finding_name, share_text
from flexviz.wording.numbers import listed

LIKELY = 0.5  # confidence from which a finding is likelier than not: two of these are no rivals
COUNTS = ("three", "four", "five", "six", "seven", "eight")
_NUMBERED = re.compile(r"(.*joint_?)(\d+)", re.IGNORECASE)

F = TypeVar("F", bound=FindingLike)


@dataclass(frozen=True)
class MergedFinding(Generic[F]):
    """Findings of one kind, each on a joint of its own; or a single finding of any kind."""

    members: tuple[F, ...]

    @property
    def effect(self) -> str:
        return self.members[0].effect

    def by_joint(self, joints: Sequence[str]) -> list[F]:
        """The members in the order of the robot's joints."""
        order = {name: index for index, name in enumerate(joints)}
        return sorted(self.members, key=lambda member: order.get(member.joint or "", -1))

    def name(self, joints: Sequence[str] = ()) -> str:
        """ "Coulomb friction on joints 1, 2 and 4"; `joints` are all of the robot."""
        if len(self.members) == 1:
            return finding_name(self.members[0])
        return f"{effect_title(self.effect)} on {self.place(joints)}"

    def place(self, joints: Sequence[str] = ()) -> str:
        """ "joint2", "joints 1, 2 and 4", "all six joints"."""
        return joints_text([str(member.joint) for member in self.members], joints)


def joint_score(members: Sequence[FindingLike]) -> float:
    """Share of the error above the noise that findings remove one after the other."""
    return 1 - math.prod(1 - member.score for member in members)


def confidence_range(members: Sequence[FindingLike]) -> str:
    """ "99 %", or the range "94 … 99 %"."""
    shown = [share_text(value) for value in sorted(member.confidence for member in members)]
    low, high = shown[0], shown[-1]
    return high if low == high else f"{low.removesuffix(' %')} … {high}"


def joints_text(names: Sequence[str], joints: Sequence[str] = ()) -> str:
    """Names of joints in a sentence; `joints` are all of the robot."""
    if len(names) == len(joints) and 3 <= len(names) < 3 + len(COUNTS):
        return f"all {COUNTS[len(names) - 3]} joints"
    found = [_NUMBERED.fullmatch(name) for name in names]
    prefixes = {match[1] for match in found if match is not None}
    if len(names) > 1 and None not in found and len(prefixes) == 1:
        return f"joints {listed([str(n) for n in sorted(int(match[2]) for match in found if match)])}"
    order = {name: index for index, name in enumerate(joints)}
    return listed(sorted(names, key=lambda name: order.get(name, 0)))


def merged_findings(findings: Iterable[F]) -> list[MergedFinding[F]]:
    """Findings that are likelier than not with the others of their kind, at the place of the first."""
    found: dict[object, list[F]] = {}
    for k, finding in enumerate(findings):
        key = finding.effect if finding.confidence >= LIKELY and on_a_joint(finding) else k
        found.setdefault(key, []).append(finding)
    return [MergedFinding(tuple(members)) for members in found.values()]


def merged_texts(texts: Iterable[str], joints: Sequence[str]) -> list[tuple[str, ...]]:
    """Effects by their texts ("coulomb_friction:joint2"), those of one kind on joints together."""
    found: dict[str, list[str]] = {}
    for text in texts:
        name, _, place = text.partition(":")
        found.setdefault(name if place in joints else text, []).append(text)
    return [tuple(members) for members in found.values()]


def text_names(texts: Iterable[str], joints: Sequence[str]) -> list[str]:
    """Names of effects given by their texts, one per kind."""
    return [merged_name(members, joints) for members in merged_texts(texts, joints)]


def merged_name(texts: Sequence[str], joints: Sequence[str]) -> str:
    """Name of effects of one kind given by their texts."""
    if len(texts) == 1:
        return effect_text_name(texts[0])
    places = [text.partition(":")[2] for text in texts]
    return f"{effect_title(texts[0].partition(':')[0])} on {joints_text(places, joints)}"


def text_runs(added: Sequence[Sequence[str]], joints: Sequence[str]) -> list[tuple[str, list[str], int]]:
    """A staircase with neighbouring steps of one kind joined.

    Args:
        added: texts of the effects that each step adds, in order.
        joints: all joints of the robot.

    Returns:
        name, texts and index of the last step of each run.
    """
    out: list[tuple[list[str], int]] = []
    for k, texts in enumerate(added):
        whole = [*out[-1][0], *texts] if out else []
        if out and texts and out[-1][0] and len(merged_texts(whole, joints)) == 1:
            out[-1] = whole, k
        else:
            out.append((list(texts), k))
    return [(listed(text_names(texts, joints)) if texts else "", texts, k) for texts, k in out]


def on_a_joint(finding: FindingLike) -> bool:
    """Whether an effect belongs to a joint, in all groups."""
    return finding.joint is not None and finding.group is None and finding.payload is None
