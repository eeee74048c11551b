"""Find wrong units, signs and zero positions: with which changes the robot's masses explain the torques."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from flexviz.importing.column_names import CURRENT
from flexviz.importing.cross_checks import ColumnChange, change_of, conversions, theta_changes
from flexviz.importing.mapping import Fix, Issue, Mapping
from flexviz.importing.mix_ups import check_gears, check_order
from flexviz.importing.thresholds import LIMITS
from flexviz.importing.torque_model import Reading, TorqueModel, improvement
from flexviz.measurements import Array
from flexviz.wording import listed

LARGEST_FAULT_COUNT = 6  # changes that are searched one after the other


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """An assumed reading of the columns, the fixes of the mapping that lead to it, and their description."""

    reading: Reading
    fixes: tuple[Fix, ...]
    reason: str


@dataclass(frozen=True, eq=False)
class SearchResult:
    """Issues found, the reading that resolves them, and the share of each joint's torque it explains (n,)."""

    issues: list[Issue]
    reading: Reading
    shares: Array


def check_torques(mapping: Mapping, model: TorqueModel) -> list[Issue]:
    """Everything about units, signs and zero positions that the torques contradict."""
    by_q, factors = check_theta_by_q(mapping, model)
    if not model.usable:
        return merged(by_q, mapping)
    if gears := check_gears(mapping, model):
        return merged([*by_q, gears], mapping)
    start = Reading.unchanged(model.robot.n)
    for j, factor in factors.items():
        start.factor[j] = factor
    result = search(mapping, model, start, any_scale=False)
    if np.min(result.shares) < LIMITS.smallest_share:  # τ may have another scale too: then its shape decides
        other = search(mapping, model, start, any_scale=True)
        if np.sum(other.shares) > np.sum(result.shares) + LIMITS.gain:
            result = replace(other, shares=model.shares(other.reading, any_scale=False))
    order = check_order(mapping, model, result.shares)
    if order is not None and order.severity == "wrong":  # whatever else would explain a little more
        return merged([*by_q, order], mapping)
    found = [*result.issues, *by_q, *check_scale(mapping, model, result), *([order] if order else [])]
    known = {joint for issue in found for joint in issue.joints}
    shares = zip(mapping.names, result.shares, strict=True)
    poor = {joint: share for joint, share in shares if share < LIMITS.unexplained and joint not in known}
    if poor:
        texts = list(map(percent, poor.values()))
        if len(set(texts)) > 1:
            texts = [f"{text} ({joint})" for joint, text in zip(poor, texts, strict=True)]
        message = (
            f"the robot's masses explain {listed(list(dict.fromkeys(texts)))} of it: are robot, payload, "
            "order of the joints, units, signs and zero positions right, and does the base stand upright?"
        )
        found.append(Issue("unexplained", "odd", tuple(poor), "tau", message))
    return merged(found, mapping)


def search(mapping: Mapping, model: TorqueModel, reading: Reading, any_scale: bool) -> SearchResult:
    """Look for changes that explain the torques much better, one after the other."""
    least_gain = LIMITS.free_gain if any_scale else LIMITS.gain
    shares = model.shares(reading, any_scale)
    found: list[Issue] = []
    for _ in range(LARGEST_FAULT_COUNT):
        if not any_scale and np.min(shares) >= LIMITS.explained_well:
            break
        best, best_gain, best_shares = None, 0.0, shares
        for other in hypotheses(mapping, model, reading, any_scale):
            tried = model.shares(other.reading, any_scale)
            changed = tried[[mapping.names.index(fix.joint) for fix in other.fixes]]
            # a joint whose unit is corrected can still have a wrong sign, which is found next
            weakest = np.max(changed) if other.fixes[0].key in ("unit", "side") else np.min(changed)
            gain = float(np.sum(tried) - np.sum(shares))
            gain += LIMITS.stated_gear * len(changed) if other.fixes[0].key == "side" else 0.0
            worth = gain >= least_gain and weakest >= LIMITS.smallest_share
            if worth and gain > best_gain + 0.02:
                best, best_gain, best_shares = other, gain, tried
        if best is None:
            break
        if {(fix.signal, fix.key) for fix in best.fixes} == {("theta", "sign")}:
            best, best_shares = torque_sign_instead(mapping, model, reading, best, best_shares, any_scale)
        found.append(issue_of(best, shares, best_shares, mapping))
        reading, shares = best.reading, best_shares
    return SearchResult(found, reading, shares)


def hypotheses(mapping: Mapping, model: TorqueModel, now: Reading, any_scale: bool) -> list[Hypothesis]:
    """Possible faults: θ or τ of one joint, or the signs or the unit of θ of all joints.

    If τ may have any scale, the unit of θ of a single joint cannot be determined.
    """
    names = mapping.names
    result = opposite_signs(mapping, now, names) if len(names) > 1 else []
    units = [into_range(mapping, model, j, now.factor[j]) for j in range(len(names))]
    for label in sorted({label for changes in units for label in changes}):
        result.append(rescaled(now, {j: c[label] for j, c in enumerate(units) if label in c}, label))
    for j, joint in enumerate(names):
        result += opposite_signs(mapping, now, (joint,))
        result += [rescaled(now, {j: c}, label) for label, c in units[j].items() if not any_scale]
        result += other_zeros(mapping, model, now, j)
    return result


def other_zeros(mapping: Mapping, model: TorqueModel, now: Reading, j: int) -> list[Hypothesis]:
    """θ of joint j a quarter or half turn further; none for a prismatic one."""
    joint, result = mapping.names[j], []
    for quarter in () if model.robot.prismatic[j] else (1, -1, 2):
        zero = now.zero.copy()
        zero[j] += quarter * np.pi / 2
        offset = round(mapping.joints[joint].theta.offset + float(zero[j]), 6)
        fix = Fix(joint, "theta", "offset", offset)
        result.append(Hypothesis(replace(now, zero=zero), (fix,), f"offset = {offset:g} rad"))
    return result


def torque_sign_instead(
    mapping: Mapping, model: TorqueModel, now: Reading, best: Hypothesis, shares: Array, any_scale: bool
) -> tuple[Hypothesis, Array]:
    """The opposite sign of τ for that of θ in `best` where it explains as much, if need be with another zero.

    Logs have θ as the robot's description more often than τ, and a wrong zero beside a wrong sign of τ looks
    like a wrong sign of θ.
    """
    joints = tuple(dict.fromkeys(fix.joint for fix in best.fixes))
    tau = opposite_signs(mapping, now, joints)[0]

    plain = model.shares(tau.reading, any_scale)
    if improvement(plain, shares) < LIMITS.clear:
        reason = f"{tau.reason} (or that of theta instead, which these data do not tell apart)"
        return replace(tau, reason=reason), plain

    def with_zero(start: Hypothesis) -> tuple[Hypothesis, Array]:
        """The best other zero beside a sign."""
        joints = range(len(mapping.names))
        zeros = [zero for j in joints for zero in other_zeros(mapping, model, start.reading, j)]
        tried = [model.shares(zero.reading, any_scale) for zero in zeros]
        k = int(np.argmax([improvement(shares, one) for one in tried]))
        reason = f"{start.reason} of {start.fixes[0].signal} and {zeros[k].reason} of theta"
        return Hypothesis(zeros[k].reading, (*start.fixes, *zeros[k].fixes), reason), tried[k]

    other, others_shares = with_zero(tau)
    if improvement(shares, others_shares) > max(LIMITS.clear, improvement(shares, with_zero(best)[1])):
        return other, others_shares
    return best, shares


def opposite_signs(mapping: Mapping, now: Reading, joints: Sequence[str]) -> list[Hypothesis]:
    """τ, θ, or both with the opposite sign on these joints."""

    def in_words(fixes: tuple[Fix, ...]) -> str:
        values = {fix.value for fix in fixes}
        return f"sign = {values.pop()}" if len(values) == 1 else "the opposite sign"

    minus = np.array([-1.0 if joint in joints else 1.0 for joint in mapping.names])
    theta = tuple(Fix(joint, "theta", "sign", -mapping.joints[joint].theta.sign) for joint in joints)
    tau = tuple(Fix(joint, "tau", "sign", -mapping.joints[joint].tau.sign) for joint in joints)
    turned = replace(now, factor=now.factor * minus, zero=now.zero * minus)
    return [
        Hypothesis(replace(now, sign=now.sign * minus), tau, in_words(tau)),
        Hypothesis(turned, theta, in_words(theta)),
        Hypothesis(replace(turned, sign=now.sign * minus), theta + tau, "opposite signs of theta and tau"),
    ]


def rescaled(now: Reading, changes: dict[int, ColumnChange], reason: str) -> Hypothesis:
    """θ in another unit on some joints."""
    factor = now.factor.copy()
    for j, change in changes.items():
        factor[j] *= change.factor
    fixes = tuple(fix for change in changes.values() for fix in change.fixes)
    return Hypothesis(replace(now, factor=factor), fixes, reason)


def issue_of(best: Hypothesis, before: Array, after: Array, mapping: Mapping) -> Issue:
    """The issue that a hypothesis resolves."""
    joints = tuple(dict.fromkeys(fix.joint for fix in best.fixes))
    worst = int(np.argmax(after - before))
    whose = "its torque" if joints == (mapping.names[worst],) else f"the torque of {mapping.names[worst]}"
    message = (
        f"with {best.reason} the robot's masses explain {percent(after[worst])} of {whose} "
        f"instead of {percent(before[worst])}"
    )
    signals = " and ".join(dict.fromkeys(fix.signal for fix in best.fixes))
    key = best.fixes[0].key
    if key == "offset":
        return Issue("zero", "odd", joints, signals, message, best.fixes)
    return Issue("sign" if key == "sign" else "unit", "wrong", joints, signals, message, best.fixes)


def into_range(mapping: Mapping, model: TorqueModel, j: int, already: float) -> dict[str, ColumnChange]:
    """Changes that bring a motion too large for joint j into its range, or a very small one up.

    `already` is the factor assumed so far. Where q is recorded it decides, not the torques.
    """
    if model.q_ratio[j] and in_range(model, j, 1.0 / model.q_ratio[j]):
        return {}
    span, speed = model.span[j] * abs(already), model.speed[j] * abs(already)
    too_large = span > model.width[j] or speed > model.fastest[j]
    return {
        str(change): change
        for change in theta_changes(mapping, mapping.names[j])
        if (too_large if change.factor < 1.0 else span < LIMITS.small_motion)
        and in_range(model, j, already * change.factor)
    }


def in_range(model: TorqueModel, j: int, factor: float) -> bool:
    """Whether θ times `factor` is a motion that joint j can make."""
    span, speed = model.span[j] * abs(factor), model.speed[j] * abs(factor)
    return span < LIMITS.beyond * model.width[j] and speed < LIMITS.beyond * model.fastest[j]


def check_theta_by_q(mapping: Mapping, model: TorqueModel) -> tuple[list[Issue], dict[int, float]]:
    """θ that q contradicts, and the factor that θ needs: joint's index -> factor.

    Only where q is a motion that the joint can make and θ is not: else q may be wrong.
    """
    found: list[Issue] = []
    factors: dict[int, float] = {}
    for j, joint in enumerate(mapping.names):
        ratio = abs(model.q_ratio[j])
        if not ratio or agrees(ratio) or in_range(model, j, 1.0) or not in_range(model, j, 1 / ratio):
            continue
        message = f"it turns {ratio:.5g} times as far as q"
        changes = [c for c in theta_changes(mapping, joint) if agrees(ratio * c.factor)]
        factors[j] = changes[0].factor if changes else 1 / ratio
        if changes:
            message += f": with {changes[0]} they agree"
        else:
            message += f': is that the motor\'s angle before a gear (gear = {ratio:.4g}, side = "motor")?'
        fixes = changes[0].fixes if changes else ()
        found.append(Issue("unit", "wrong", (joint,), "theta", message, fixes))
    return found, factors


def agrees(ratio: float) -> bool:
    """Whether a ratio is 1 except for the deflection of the spring."""
    return 1 / LIMITS.agrees < ratio < LIMITS.agrees


def check_scale(mapping: Mapping, model: TorqueModel, result: SearchResult) -> list[Issue]:
    """Torques that follow the robot's masses by a wrong factor."""
    found: list[Issue] = []
    unknown: dict[str, float] = {}
    fits = model.fit_any_scale(result.reading)
    for joint, fit, share in zip(mapping.names, fits, result.shares, strict=True):
        explained = min(fit.share - share, fit.by_masses) >= LIMITS.scale_gain
        if not explained or fit.share < LIMITS.smallest_share:
            continue
        change = torque_change(mapping, joint, fit.slope)
        if change is None:
            unknown[joint] = fit.slope
            continue
        ratio = f"it is {fit.slope:.3g} times the torque of the rigid model"
        message = f"{ratio}: with {change} it is {fit.slope * change.factor:.2g} times"
        found.append(Issue("unit", "wrong", (joint,), "tau", message, change.fixes))
    for large in (True, False):
        slopes = {joint: slope for joint, slope in unknown.items() if (slope > 1.0) == large}
        if not slopes:
            continue
        ratios = ", ".join(f"{slope:.3g}" for slope in slopes.values())
        message = f"it is {ratios} times the torque of the rigid model: {scale_hint(mapping, slopes)}?"
        found.append(Issue("unit", "wrong", tuple(slopes), "tau", message))
    return found


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


def torque_change(mapping: Mapping, joint: str, slope: float) -> ColumnChange | None:
    """The unit or side of τ, or both, with which its slope is near 1; as few changes as possible."""
    currents = CURRENT if mapping.joints[joint].torque_constant else ()
    single = conversions(mapping, joint, "tau", tuple(currents))
    units, sides = ([{}, *(one for one in single if key in one)] for key in ("unit", "side"))
    combined = [change_of(mapping, joint, "tau", unit | side) for unit, side in product(units, sides)]
    low, high = LIMITS.slopes
    correct = [change for change in combined if low < slope * change.factor < high]
    return min(correct, key=lambda x: (len(x.fixes), abs(np.log(slope * x.factor))), default=None)


def merged(found: Sequence[Issue], mapping: Mapping) -> list[Issue]:
    """One issue for the same unit on several joints, extended to joints stated alike where most have it."""
    result = [issue for issue in found if issue.kind != "unit" or not issue.fixes]
    alike: dict[tuple[tuple[str, str, str | float | int], ...], list[Issue]] = {}
    for issue in found:
        if issue.kind == "unit" and issue.fixes:
            change = tuple((f.signal, f.key, f.value) for f in issue.fixes if f.joint == issue.joints[0])
            alike.setdefault(change, []).append(issue)
    for change, same in alike.items():
        joints = {joint for issue in same for joint in issue.joints}
        signals = {joint: getattr(mapping.joints[joint], change[0][0]) for joint in mapping.names}
        if 2 * len(joints) > len(mapping.names):
            first = signals[same[0].joints[0]]
            joints |= {j for j, s in signals.items() if (s.unit, s.side) == (first.unit, first.side)}
        ordered = tuple(joint for joint in mapping.names if joint in joints)
        fixes = tuple(Fix(joint, *one) for joint in ordered for one in change)
        result.append(replace(same[0], joints=ordered, fixes=fixes))
    return result


def percent(share: float) -> str:
    """A share in words."""
    return "nothing" if share <= 0.005 else f"{100 * share:.0f} %"
