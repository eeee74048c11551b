"""What is probably wrong with the columns: the most probable reading of them, and how it is told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexviz.content.wording import listed
from flexviz.data.importing.comparison import Comparison, Reading
from flexviz.data.importing.mapping import Issue, IssueKind, Mapping
from flexviz.data.importing.proposals import Proposal
from flexviz.data.importing.readings import Change, changes, sizes
from flexviz.data.importing.thresholds import LIMITS
from flexviz.data.measurements import Array

WIDTH, DEPTH = 3, 6  # readings that are followed at a time, and things that may be wrong at once
ALIKE = float(np.log(LIMITS.alike))
SURE = float(np.log(LIMITS.sure / (1 - LIMITS.sure)))  # odds


@dataclass(frozen=True, eq=False)
class Node:
    """A reading, what it changes, and the logarithm of its probability (up to a constant)."""

    reading: Reading
    score: float
    done: tuple[Change, ...] = ()
    alike: tuple[Change, ...] = ()  # instead of the last of `done`, what explains the torques as well


def search(mapping: Mapping, comparison: Comparison, payloads_known: bool) -> Node:
    """The most probable reading; each of its changes makes it much more probable."""
    start = Reading.unchanged(comparison.robot)
    found = follow(mapping, comparison, Node(start, comparison.score(start)), payloads_known, True)
    if not found.done and np.min([fit.share for fit in comparison.fits(start)]) > LIMITS.explained:
        return found
    # a wrong sign and a wrong size hide one another: first the shape, then the size
    free = replace(start, free=np.ones(comparison.robot.n, bool))
    shape = follow(mapping, comparison, Node(free, comparison.score(free)), payloads_known, False)
    reading = replace(shape.reading, free=start.free)
    prior = sum(change.prior for change in shape.done)
    node = Node(reading, comparison.score(reading) + prior, shape.done, shape.alike)
    other = follow(mapping, comparison, node, payloads_known, True)
    return other if other.score > found.score + SURE else found


def follow(
    mapping: Mapping, comparison: Comparison, start: Node, payloads_known: bool, sizes_too: bool
) -> Node:
    """The best reading by changes one after the other, several readings being followed at a time."""
    best, beam = start, [start]
    for _ in range(DEPTH):
        children: list[Node] = []
        for node in beam:
            room = comparison.room(node.reading)
            every = changes(mapping, comparison, node.reading, payloads_known)
            if sizes_too:
                every += sizes_of(mapping, comparison, node.reading)
            tried = best_of(comparison, node, [c for c in every if worth(c, node, room)])
            for score, change in tried:
                if score < node.score + SURE:
                    continue
                alike = tuple(
                    c for s, c in tried if c is not change and s > score - ALIKE and c.signals != "range"
                )
                children.append(Node(change.reading, score, (*node.done, change), alike))
        if not children:
            break
        beam = sorted(children, key=lambda node: -node.score)[:WIDTH]
        best = max(
            best, *(node for node in beam if explains(comparison, node)), start, key=lambda node: node.score
        )
    return best


def worth(change: Change, node: Node, room: Array) -> bool:
    """Whether a change could make a reading that probable, and is none of what was done already."""
    own = room[list(change.joints)] if change.signals == "tau" else room
    return float(np.sum(own)) + change.prior >= SURE and not repeats(change, node.done)


def best_of(comparison: Comparison, node: Node, every: Sequence[Change]) -> list[tuple[float, Change]]:
    """Changes of a node's reading with their scores, but for those that are certainly none of the best.

    A bound of all scores tells which must be computed; it is compared with its own value for the node.
    """
    before = sum(change.prior for change in node.done)
    spare = comparison.bound(node.reading, few=False) - comparison.bound(node.reading) + before
    bounds = [comparison.bound(change.reading) + change.prior + spare for change in every]
    tried: list[tuple[float, Change]] = []
    needed = node.score + SURE
    for i in np.argsort(bounds)[::-1]:
        if bounds[i] < needed - ALIKE:
            break
        change = every[i]
        tried.append((comparison.score(change.reading) + change.prior + before, change))
        needed = max([needed, *sorted((score for score, _ in tried), reverse=True)[WIDTH - 1 : WIDTH]])
    return tried


def sizes_of(mapping: Mapping, comparison: Comparison, reading: Reading) -> list[Change]:
    found = list(sizes(mapping, comparison, reading))
    share = np.log(LIMITS.fault / max(len(found), 1))
    return [replace(change, prior=change.prior + share) for change in found]


def repeats(change: Change, done: Sequence[Change]) -> bool:
    """Whether something of the same kind was changed on one of its joints already."""
    return any(
        change.kind == other.kind
        and change.signals == other.signals
        and set(change.joints) & set(other.joints)
        for other in done
    )


def explains(comparison: Comparison, node: Node) -> bool:
    """Whether the torques of the changed joints are explained: what is not may be improved by chance."""
    shares = np.array([fit.share for fit in comparison.fits(node.reading)])
    return all(np.median(shares[list(change.joints)]) >= LIMITS.explained for change in node.done)


def check_torques(mapping: Mapping, comparison: Comparison, payloads_known: bool) -> list[Issue]:
    """Everything that the torques contradict: what is probably wrong, and joints that stay unexplained."""
    if not comparison.usable:
        return []
    best = search(mapping, comparison, payloads_known)
    now = Reading.unchanged(comparison.robot)
    found = []
    for change in best.done:
        alike = best.alike if change is best.done[-1] else ()
        if change.reading.converted:  # only friction is coupled: nothing is wrong with the columns
            plain = [other for other in alike if other.kind == "coupling" and not other.reading.converted]
            told, alike = (plain[0], (change,)) if plain else (None, ())
        else:
            told = change
        if change.signals == "range":
            found.append(unknown_unit(mapping, comparison, now, change))
        elif told is not None:
            found += issues_of(mapping, comparison, now, told, alike)
        now = change.reading
    known = {joint for issue in found for joint in issue.joints}
    poor = {}
    for joint, fit in zip(mapping.names, comparison.fits(best.reading), strict=True):
        # gravity and inertia that cancel, as near a resonance, leave less than the masses' own error
        error = LIMITS.mass_spread**2 * fit.parts
        if fit.share < LIMITS.unexplained and 1.0 - fit.share > error and joint not in known:
            poor[joint] = fit.share
    if poor:
        texts = list(map(percent, poor.values()))
        if len(set(texts)) > 1:
            texts = [f"{text} ({joint})" for joint, text in zip(poor, texts, strict=True)]
        message = (
            f"the robot's masses explain {listed(list(dict.fromkeys(texts)))} of it: are robot, payload, "
            "order of the joints, units, signs and zero positions right, and does the base stand upright?"
        )
        found.append(Issue("unexplained", "odd", tuple(poor), "tau", message))
    return found


def unknown_unit(mapping: Mapping, comparison: Comparison, now: Reading, change: Change) -> Issue:
    """θ in no unit that is known: what one of it seems to be."""
    before, after = comparison.fits(now), comparison.fits(change.reading)
    worst = max(change.joints, key=lambda j: after[j].score - before[j].score)
    joints = tuple(mapping.names[j] for j in change.joints)
    scales = [abs(mapping.joints[n].scale(mapping.joints[n].theta)) for n in joints]
    sizes = [abs(change.reading.factor[j]) * s for j, s in zip(change.joints, scales, strict=True)]
    gears = [abs(now.factor[j] / change.reading.factor[j]) for j in change.joints]
    units, ratios = (listed([f"{x:.2g}" for x in one]) for one in (sizes, gears))
    message = (
        f"no known unit explains it. With about {units} rad per unit the robot's masses explain "
        f"{percent(after[worst].share)} of the torque of {mapping.names[worst]} instead of "
        f"{percent(before[worst].share)}: the motor's angle before a gear of about {ratios} (gear, side), or "
        "per cent of the joint's range (unit = the size of one in rad)?"
    )
    return Issue("unit", "wrong", joints, "theta", message)


def issues_of(
    mapping: Mapping, comparison: Comparison, now: Reading, change: Change, alike: Sequence[Change]
) -> list[Issue]:
    """The issue that a change resolves; one for each joint whose θ q contradicts."""
    if change.kind == "unit" and not change.fixes:
        return [
            Issue(
                "unit",
                "wrong",
                (mapping.names[j],),
                "theta",
                f"it turns {abs(comparison.by_q[j]):.5g} times as far as q: is that the motor's angle before "
                f'a gear (gear = {abs(comparison.by_q[j]):.4g}, side = "motor")?',
            )
            for j in change.joints
        ]
    before, after = comparison.fits(now), comparison.fits(change.reading)
    worst = max(range(len(after)), key=lambda j: after[j].score - before[j].score)
    joints = tuple(mapping.names[j] for j in change.joints)
    whose = "its torque" if joints == (mapping.names[worst],) else f"the torque of {mapping.names[worst]}"
    gained = f"{percent(after[worst].share)} of {whose} instead of {percent(before[worst].share)}"
    message = f"with {change.reason} the robot's masses explain {gained}"
    if change.kind == "gravity":
        message = without_part(change.reading, gained)
    elif change.kind == "size":
        message = size_message(mapping, comparison, now, change)
    elif change.signals == "theta and tau" and change.kind == "unit":
        stated = 'their gears are stated, but not used: both signals have side = "joint". '
        message = stated + message[0].upper() + message[1:]
    elif change.kind == "magnitude":
        lost = "it is never negative, as if it had lost its sign: "
        message = f"{lost}{message}. Log the torque or current with its sign"
    elif change.kind == "mounting":
        message += ": is the robot mounted on a wall, on its side or under a ceiling?"
    elif change.kind == "order":
        message += ": is the order of the joints right?"
    message += "".join(f"; or {other_cause(mapping, other, change)}" for other in alike[:2])
    message += ", which these data do not tell apart" if alike else ""
    doubtful = (
        any(other.kind != change.kind for other in alike)
        or change.kind in ("zero", "coupling", "payload")
        or not supported(comparison, now, change)
    )
    kind: IssueKind = "unit" if change.kind == "size" else change.kind
    stated = (Proposal((), "gravity", list(change.reading.down)),) if kind == "mounting" else ()
    severity = "odd" if doubtful else "wrong"
    return [Issue(kind, severity, joints, change.signals, message, change.fixes, stated)]


def other_cause(mapping: Mapping, other: Change, told: Change) -> str:
    """A change that explains the torques as well, in a few words."""
    if other.reading.converted:
        return "tau was converted already and only the friction is coupled"
    joints = [mapping.names[j] for j in other.joints]
    whose = (
        "" if other.joints == told.joints or len(joints) == len(mapping.names) else f" of {listed(joints)}"
    )
    return f"{other.reason} of {other.signals}{whose}" if other.fixes else other.reason


def supported(comparison: Comparison, now: Reading, change: Change) -> bool:
    """Whether more than the shape of one joint's torque speaks for a change.

    That is several joints' torques, friction or inertia below zero otherwise, the joints' range, or a size
    that no masses explain.
    """
    if change.kind == "size":
        free = comparison.fits(replace(now, free=np.ones(len(now.size), bool)))
        factors = np.array([free[j].slope for j in change.joints])
        return bool(np.any(np.abs(np.log(factors)) > np.log(LIMITS.far_beyond)))
    before, after = comparison.fits(now), comparison.fits(change.reading)
    better = sum(b.score - a.score > SURE for a, b in zip(before, after, strict=True))
    range_too = np.sum(comparison.beyond(now)) > np.sum(comparison.beyond(change.reading))
    return better > 1 or bool(range_too) or any(comparison.unphysical(now, j) for j in change.joints)


def without_part(reading: Reading, gained: str) -> str:
    """What τ lacks, and what to do."""
    if reading.motion:
        return (
            "it has the torque of the motion, but not that of gravity (factor 0): without it the robot's "
            f"masses explain {gained}. Was it logged before the controller adds its gravity compensation? Log"
            " the whole torque, or add that part"
        )
    return (
        f"it has the torque of gravity and nothing else: gravity alone explains {gained}. Is it a computed "
        "torque, or was the arm moved by hand? Log the motors' torque while they drive the motion"
    )


def size_message(mapping: Mapping, comparison: Comparison, now: Reading, change: Change) -> str:
    """How large τ is against the robot's masses, and what would explain it."""
    factors = {j: abs(now.size[j] / change.reading.size[j]) for j in change.joints}
    free = comparison.fits(replace(now, free=np.ones(len(now.size), bool)))
    slopes = {j: free[j].slope for j in change.joints}
    if change.fixes:
        j = change.joints[0]
        return (
            f"it is {slopes[j]:.3g} times the torque of the rigid model: with {change.reason} it is "
            f"{slopes[j] / factors[j]:.2g} times"
        )
    ratios = ", ".join(dict.fromkeys(f"{slope:.3g}" for slope in slopes.values()))
    hint = scale_hint(mapping, {mapping.names[j]: slope for j, slope in slopes.items()})
    return f"it is {ratios} times the torque of the rigid model: {hint}?"


def scale_hint(mapping: Mapping, slopes: dict[str, float]) -> str:
    """Possible reasons for τ of another size, where no unit or gear of the mapping explains it."""
    if min(slopes.values()) > 1:
        return "a smaller unit, or a gear counted twice"
    gears = [mapping.joints[joint].ratio for joint in slopes]
    if 1.0 not in gears:
        about = ", ".join(f"{1 / s / gear:.2g}" for s, gear in zip(slopes.values(), gears, strict=True))
        return f'a current (unit = "A", side = "motor", torque_constant about {about} Nm/A)'
    about = ", ".join(f"{1 / s:.2g}" for s in slopes.values())
    return f'a current (unit = "A", torque_constant), or before a gear (of about {about}; gear, side)'


def percent(share: float) -> str:
    """A share in words."""
    return "nothing" if share <= 0.005 else f"{100 * share:.0f} %"
