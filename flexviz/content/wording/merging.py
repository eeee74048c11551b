"""Effects of one kind on several joints as one finding with a value per joint."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from flexviz.base.spelling import listed
from flexviz.content.records import CandidateEffect, DiagnosisLike, FindingKey, FoundEffect, finding_key
from flexviz.content.wording.findings import (
    UNTOLD,
    capitalised,
    confidence_of,
    effect_text_name,
    effect_title,
    family_title,
    finding_name,
    finding_title,
    share_text,
    tied_family,
)

LIKELY = 0.5  # confidence from which a finding is likelier than not: two of these are no rivals
COUNTS = ("three", "four", "five", "six", "seven", "eight")
_NUMBERED = re.compile(r"(.*joint_?)(\d+)", re.IGNORECASE)


N = TypeVar("N", bound=FoundEffect)
F = TypeVar("F", bound=CandidateEffect)
Families = Mapping[str, str]  # "coulomb_friction:joint2" -> name of its family, of effects that stand for one


@dataclass(frozen=True)
class MergedFinding(Generic[N]):
    """Findings of one effect, or of one family, each on a joint of its own; or a single finding.

    Attributes:
        members: the findings.
        share: of the error that they remove together; None if unknown.
    """

    members: tuple[N, ...]
    share: float | None = None

    @property
    def effect(self) -> str:
        return self.members[0].effect

    @property
    def tied(self) -> bool:
        """Whether the data do not tell which effect of a family acts."""
        return tied_family(self.members[0]) is not None

    def by_joint(self, joints: Sequence[str]) -> list[N]:
        """The members in the order of the robot's joints."""
        order = {name: index for index, name in enumerate(joints)}
        return sorted(self.members, key=lambda member: order.get(member.joint or "", -1))

    def name(self, joints: Sequence[str] = ()) -> str:
        """ "Coulomb friction on joints 1, 2 and 4"; `joints` are all of the robot."""
        if len(self.members) == 1:
            return finding_name(self.members[0])
        return f"{finding_title(self.members[0])} on {self.place(joints)}"

    def statement(self, joints: Sequence[str] = ()) -> str:
        """The name; of a family: "Dry friction on joint1; these data do not tell which kind"."""
        return f"{self.name(joints)}; {UNTOLD}" if self.tied else self.name(joints)

    def place(self, joints: Sequence[str] = ()) -> str:
        """ "joint2", "joints 1, 2 and 4", "all six joints"."""
        return joints_text([str(member.joint) for member in self.members], joints)


def joint_score(members: Sequence[CandidateEffect]) -> float:
    """Share of the error above the noise that findings remove one after the other."""
    return 1 - math.prod(1 - member.score for member in members)


def removes_text(merged: MergedFinding[F]) -> str:
    """ "removes 98 % of the error"; if that is unknown, of the error above the noise that it explains."""
    many = len(merged.members) > 1
    if merged.share is not None:
        return f"{'together they remove' if many else 'removes'} {share_text(merged.share)} of the error"
    explain = "together they explain" if many else "explains"
    return f"{explain} {share_text(joint_score(merged.members))} of the error above the noise"


def confidence_range(members: Sequence[FoundEffect]) -> str:
    """ "99 %", or the range "94 … 99 %"."""
    shown = [share_text(value) for value in sorted(map(confidence_of, members))]
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


def merged_findings(
    findings: Iterable[N], shares: Mapping[FindingKey, float] | None = None
) -> list[MergedFinding[N]]:
    """Findings that are likelier than not with the others of their kind; what removes most comes first.

    Args:
        findings: in an order that is kept where shares are unknown; those come last.
        shares: of the error, as from `found_shares`; default: those that the findings carry.
    """
    found: dict[object, list[N]] = {}
    for k, finding in enumerate(findings):
        family = tied_family(finding)
        key = (finding.effect, "") if family is None else ("", family.name)
        on_a_joint = finding.joint is not None and finding.group is None and finding.payload is None
        likely = confidence_of(finding) >= LIKELY and on_a_joint
        found.setdefault(key if likely else k, []).append(finding)
    merged = [MergedFinding(tuple(members), _share(members, shares)) for members in found.values()]
    return sorted(merged, key=lambda one: 1.0 if one.share is None else -one.share)


def _share(members: Sequence[FoundEffect], shares: Mapping[FindingKey, float] | None) -> float | None:
    """Share of the error that findings remove together; None if one of theirs is unknown."""
    own = [one.share if shares is None else shares.get(finding_key(one)) for one in members]
    known = [share for share in own if share is not None]
    return sum(known) if len(known) == len(own) else None


def merged_texts(
    texts: Iterable[str], joints: Sequence[str], families: Families | None = None
) -> list[tuple[str, ...]]:
    """Effects by their texts ("coulomb_friction:joint2"), those of one kind on joints together."""
    found: dict[object, list[str]] = {}
    for text in texts:
        name, _, place = text.partition(":")
        family = (families or {}).get(text, "")
        found.setdefault((family or name, bool(family)) if place in joints else text, []).append(text)
    return [tuple(members) for members in found.values()]


def text_names(texts: Iterable[str], joints: Sequence[str], families: Families | None = None) -> list[str]:
    """Names of effects given by their texts, one per kind."""
    return [merged_name(members, joints, families) for members in merged_texts(texts, joints, families)]


def merged_name(texts: Sequence[str], joints: Sequence[str], families: Families | None = None) -> str:
    """Name of effects of one kind given by their texts."""
    family = (families or {}).get(texts[0], "")
    if len(texts) == 1:
        return effect_text_name(texts[0], family)
    places = [text.partition(":")[2] for text in texts]
    title = capitalised(family_title(family)) if family else effect_title(texts[0].partition(":")[0])
    return f"{title} on {joints_text(places, joints)}"


def tied_families(findings: Iterable[FoundEffect]) -> dict[str, str]:
    """The families of those findings that stand for one, by their texts."""
    tied = ((finding.text, tied_family(finding)) for finding in findings)
    return {text: family.name for text, family in tied if family is not None}


def added_families(result: DiagnosisLike) -> dict[str, str]:
    """The same of a whole diagnosis: of its findings and of what its steps add."""
    added = [step.added for step in result.steps if step.added is not None]
    return tied_families([*result.findings, *added])


def text_runs(
    added: Sequence[Sequence[str]], joints: Sequence[str], families: Families | None = None
) -> list[tuple[str, list[str], int]]:
    """A staircase with neighbouring steps of one kind joined.

    Args:
        added: texts of the effects that each step adds, in order.
        joints: all joints of the robot.
        families: of those effects that stand for one.

    Returns:
        name, texts and index of the last step of each run.
    """
    out: list[tuple[list[str], int]] = []
    for k, texts in enumerate(added):
        whole = [*out[-1][0], *texts] if out else []
        if out and texts and out[-1][0] and len(merged_texts(whole, joints, families)) == 1:
            out[-1] = whole, k
        else:
            out.append((list(texts), k))
    return [(listed(text_names(texts, joints, families)) if texts else "", texts, k) for texts, k in out]
