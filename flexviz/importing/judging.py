"""Find wrong units, signs and zero positions: with which of them the robot's masses explain the torques."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexviz.importing.explaining import SLOPES, Explained, Judge
from flexviz.importing.mapping import Mapping, Torque
from flexviz.importing.suspicion import Fix, Suspicion
from flexviz.importing.theta_units import against_q, possible_ways
from flexviz.importing.traces import size_of
from flexviz.importing.units import CURRENT, TORQUE
from flexviz.measurements import Array

GOOD = 0.7  # explained share of every joint from which nothing is searched
GAIN = 0.4  # what a change must add to the sum of the joints' shares
FREE_GAIN = 0.2  # the same where τ may have any scale, which hides much of a wrong sign
STATED = 0.1  # the gain that a gear has ahead which the mapping states and does not use
BELIEVED = 0.5  # share that the changed joints must reach
POOR = 0.2  # share below which a joint is called unexplained
LOGGED_IN = ("Nm", "mNm", "Ncm")  # units that torques are really recorded in
SCALE_GAIN = 0.2  # share that another scale of τ must add to be called a wrong unit
ROUNDS = 6  # changes that are looked for one after the other


@dataclass(frozen=True, eq=False)
class Assumed:
    """What is assumed beside the mapping, θ·factor + zero and τ·sign (n,), and the fixes leading there."""

    factor: Array
    zero: Array
    sign: Array
    fixes: tuple[Fix, ...] = ()
    reason: str = ""


def judge(mapping: Mapping, judged: Judge) -> list[Suspicion]:
    """Everything about units, signs and zero positions that the torques contradict."""
    n = judged.robot.n
    by_q, factors = against_q(mapping, judged)
    if not judged.usable:
        return merged(by_q, mapping)
    factor = np.array([factors.get(j, 1.0) for j in range(n)])
    start = Assumed(factor, np.zeros(n), np.ones(n))
    found, now, shares = search(mapping, judged, start, free=False)
    if np.min(shares) < BELIEVED:  # τ may have another scale too: then it is its shape that tells
        others, then, shape = search(mapping, judged, start, free=True)
        if np.sum(shape) > np.sum(shares) + GAIN:
            found, now = others, then
            shares = shares_of(judged.explain(now.factor, now.zero, now.sign), free=False)
    found += by_q
    found += judge_scale(mapping, judged, now, shares)
    known = {joint for suspicion in found for joint in suspicion.joints}
    poor = {j: s for j, s in zip(mapping.names, shares, strict=True) if s < POOR and j not in known}
    if poor:
        message = (
            f"the robot's masses explain {', '.join(percent(s) for s in poor.values())} of it: are robot, "
            "payload, units, signs and zero positions right, and does the base stand upright?"
        )
        found.append(Suspicion("unexplained", "odd", tuple(poor), "tau", message))
    return merged(found, mapping)


def search(
    mapping: Mapping, judged: Judge, now: Assumed, free: bool
) -> tuple[list[Suspicion], Assumed, Array]:
    """Look for changes that explain the torques much better, one after the other.

    Gives the suspicions, what is assumed after them, and the joints' shares (n,). `free`: τ has any scale.
    """
    explain = judged.explain_freely if free else judged.explain
    shares = shares_of(explain(now.factor, now.zero, now.sign), free)
    found: list[Suspicion] = []
    for _ in range(ROUNDS):
        if not free and np.min(shares) >= GOOD:
            break
        best, best_gain, best_shares = None, 0.0, shares
        for other in changes(mapping, judged, now, free):
            tried = shares_of(explain(other.factor, other.zero, other.sign), free)
            changed = tried[[mapping.names.index(fix.joint) for fix in other.fixes]]
            # a joint whose unit is put right can have a wrong sign still, which is found next
            weakest = np.max(changed) if other.fixes[0].key in ("unit", "side") else np.min(changed)
            gain = float(np.sum(tried) - np.sum(shares))
            gain += STATED * len(changed) if other.fixes[0].key == "side" else 0.0
            worth = gain >= (FREE_GAIN if free else GAIN) and weakest >= BELIEVED
            if worth and gain > best_gain + 0.02:
                best, best_gain, best_shares = other, gain, tried
        if best is None:
            break
        found.append(named(best, shares, best_shares, mapping))
        now, shares = replace(best, fixes=()), best_shares
    return found, now, shares


def shares_of(explained: Sequence[Explained], free: bool) -> Array:
    """(n,) shares, no worse than −1; with a free scale only what the masses explain counts."""
    return np.array(
        [max(-1.0, min(one.share, 3.0 * one.by_masses) if free else one.share) for one in explained]
    )


def changes(mapping: Mapping, judged: Judge, now: Assumed, free: bool) -> list[Assumed]:
    """What could be otherwise: one joint's θ or τ, or all joints' signs or unit of θ.

    Where τ may have any scale (`free`), the unit of a single joint's θ cannot be told.
    """
    result: list[Assumed] = []
    every = range(len(mapping.names))
    if len(mapping.names) > 1:
        result += turned(mapping, now, mapping.names)
    units = {j: possible_ways(mapping, judged, j, now.factor[j]) for j in every}
    for label in sorted({label for ways in units.values() for label in ways}):
        result.append(with_theta(now, {j: units[j][label] for j in every if label in units[j]}, label))
    for j, joint in enumerate(mapping.names):
        result += turned(mapping, now, (joint,))
        result += [with_theta(now, {j: change}, label) for label, change in units[j].items() if not free]
        for quarter in (1, -1, 2):
            zero = now.zero.copy()
            zero[j] += quarter * np.pi / 2
            offset = round(mapping.joints[joint].theta.offset + quarter * np.pi / 2, 6)
            fix = (Fix(joint, "theta", "offset", offset),)
            result.append(replace(now, zero=zero, fixes=fix, reason=f"offset = {offset:g} rad"))
    return result


def turned(mapping: Mapping, now: Assumed, joints: Sequence[str]) -> list[Assumed]:
    """τ, θ, or both turned round on these joints."""
    minus = np.array([-1.0 if joint in joints else 1.0 for joint in mapping.names])
    turn = tuple(Fix(joint, "theta", "sign", -mapping.joints[joint].theta.sign) for joint in joints)
    back = tuple(Fix(joint, "tau", "sign", -mapping.joints[joint].tau.sign) for joint in joints)
    other = replace(now, factor=now.factor * minus, zero=now.zero * minus, fixes=turn)
    return [
        replace(now, sign=now.sign * minus, fixes=back, reason=signs(back)),
        replace(other, reason=signs(turn)),
        replace(other, sign=now.sign * minus, fixes=turn + back, reason="theta and tau both turned round"),
    ]


def signs(fixes: Sequence[Fix]) -> str:
    """How a change of signs is said."""
    values = {fix.value for fix in fixes}
    return f"sign = {values.pop()}" if len(values) == 1 else "the other sign"


def with_theta(now: Assumed, changed: dict[int, tuple[float, Fix]], reason: str) -> Assumed:
    """The unit of θ changed on some joints."""
    factor = now.factor.copy()
    for j, (by, _) in changed.items():
        factor[j] *= by
    return replace(now, factor=factor, fixes=tuple(fix for _, fix in changed.values()), reason=reason)


def named(change: Assumed, before: Array, after: Array, mapping: Mapping) -> Suspicion:
    """A change that explains the torques much better, as a suspicion."""
    joints = tuple(dict.fromkeys(fix.joint for fix in change.fixes))
    worst = int(np.argmax(after - before))
    whose = "its torque" if joints == (mapping.names[worst],) else f"the torque of {mapping.names[worst]}"
    message = (
        f"with {change.reason} the robot's masses explain {percent(after[worst])} of {whose}, "
        f"as it is {percent(before[worst])}"
    )
    kinds = {"sign": "sign", "unit": "unit", "side": "unit", "offset": "zero"}
    kind = kinds[change.fixes[0].key]
    severity = "odd" if kind == "zero" else "wrong"
    signals = " and ".join(dict.fromkeys(fix.signal for fix in change.fixes))
    return Suspicion(kind, severity, joints, signals, message, change.fixes)  # type: ignore[arg-type]


def judge_scale(mapping: Mapping, judged: Judge, now: Assumed, shares: Array) -> list[Suspicion]:
    """Torques that follow the robot's masses by a wrong factor."""
    found: list[Suspicion] = []
    unknown: dict[str, float] = {}
    freely = judged.explain_freely(now.factor, now.zero, now.sign)
    for joint, free, share in zip(mapping.names, freely, shares, strict=True):
        if free.share - share < SCALE_GAIN or free.share < BELIEVED or free.by_masses < SCALE_GAIN:
            continue
        known = other_torques(mapping, joint, free.slope)
        if known is None:
            unknown[joint] = free.slope
            continue
        message = f"it is {free.slope:.3g} times what the robot's masses ask for: {known[0]}"
        found.append(Suspicion("unit", "wrong", (joint,), "tau", message, known[1]))
    large = {joint: slope for joint, slope in unknown.items() if slope > 1.0}
    small = {joint: slope for joint, slope in unknown.items() if slope <= 1.0}
    for slopes in (large, small):
        if slopes:
            much = ", ".join(f"{slope:.3g}" for slope in slopes.values())
            message = f"it is {much} times what the robot's masses ask for: {hint(mapping, slopes)}?"
            found.append(Suspicion("unit", "wrong", tuple(slopes), "tau", message))
    return found


def hint(mapping: Mapping, slopes: dict[str, float]) -> str:
    """What τ of another size can be, where no unit or gear of the mapping explains it."""
    if min(slopes.values()) > 1:
        return "a smaller unit, or a gear counted twice"
    gears = [mapping.joints[joint].gear for joint in slopes]
    if 1.0 not in gears:
        about = ", ".join(f"{1 / s / gear:.2g}" for s, gear in zip(slopes.values(), gears, strict=True))
        return f'a current (unit = "A", side = "motor", torque_constant about {about} Nm/A)'
    about = ", ".join(f"{1 / s:.2g}" for s in slopes.values())
    return f'a current (unit = "A", torque_constant), or before a gear (of about {about}; gear, side)'


def other_torques(mapping: Mapping, joint: str, slope: float) -> tuple[str, tuple[Fix, ...]] | None:
    """The unit or side of τ, or both, with which its slope is near 1; as few changes as are needed."""
    entry = mapping.joints[joint]
    tau: Torque = entry.tau
    currents = CURRENT if entry.torque_constant is not None else {}
    units = {unit: TORQUE[unit] for unit in LOGGED_IN}
    units |= {unit: size * (entry.torque_constant or 1.0) for unit, size in currents.items()}
    now = size_of(tau.unit, TORQUE | CURRENT) * (entry.torque_constant or 1.0 if tau.unit in CURRENT else 1.0)
    other = "joint" if tau.side == "motor" else "motor"
    turn = entry.gear if other == "motor" else 1.0 / entry.gear
    ways: dict[tuple[Fix, ...], float] = {}
    for unit, size in ({tau.unit: now} | units).items():
        change = () if unit == tau.unit else (Fix(joint, "tau", "unit", unit),)
        ways[change] = size / now
        if turn != 1.0:
            ways[(*change, Fix(joint, "tau", "side", other))] = size / now * turn
    right = {change: slope * by for change, by in ways.items() if SLOPES[0] < slope * by < SLOPES[1]}
    if not right:
        return None
    change = min(right, key=lambda fixes: (len(fixes), abs(np.log(right[fixes]))))
    said = ", ".join(f'{fix.key} = "{fix.value}"' for fix in change)
    return f"with {said} it is {right[change]:.2g} times", change


def merged(found: Sequence[Suspicion], mapping: Mapping) -> list[Suspicion]:
    """The same unit on several joints as one, and on all where most have it and the mapping says the same."""
    result = [s for s in found if s.kind != "unit" or not s.fixes]
    alike: dict[tuple[tuple[str, str, str | float | int], ...], list[Suspicion]] = {}
    for s in found:
        if s.kind == "unit" and s.fixes:
            change = tuple((f.signal, f.key, f.value) for f in s.fixes if f.joint == s.joints[0])
            alike.setdefault(change, []).append(s)
    for change, same in alike.items():
        joints = [joint for s in same for joint in s.joints]
        signal = getattr(mapping.joints[joints[0]], change[0][0])
        if 2 * len(joints) > len(mapping.names):
            for joint in mapping.names:
                other = getattr(mapping.joints[joint], change[0][0])
                joints += [joint] if (other.unit, other.side) == (signal.unit, signal.side) else []
        ordered = tuple(joint for joint in mapping.names if joint in joints)
        fixes = tuple(Fix(joint, *one) for joint in ordered for one in change)
        result.append(replace(same[0], joints=ordered, fixes=fixes))
    return result


def percent(share: float) -> str:
    """A share as a person reads it."""
    return "nothing" if share <= 0.005 else f"{100 * share:.0f} %"
