"""An identification in one paragraph: what is good, what is weak, what to do and record next."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from flexviz.content.records import JointErrors, ParameterEstimate, ResidualSummary, normalised, percent_of
from flexviz.content.results.fields import ResultFields
from flexviz.content.wording import (
    error_short,
    error_whole,
    listed,
    noise_text,
    number,
    percent,
    plain_name,
    plural,
)
from flexviz.data.measurements import TorqueSide
from flexviz.robot.model import INERTIAL_NAMES

GOOD_SHARE = 0.1  # error or noise of a joint up to which it is good, relative to the spread of its torque
FAR_FROM_NOISE = 3.0  # of an error to the noise, from which the model lacks something ...
LEAST_SHARE = 0.01  # ... if the error is also this share of the torque
WORSE_HELD_OUT = 1.5  # times the error on the fitted groups
NO_MOTOR = 0.8  # share of the joints whose motor inertia ends at its lower bound: τ is not the motor's

AT_LOWEST = 1.01e-3  # of its start value: a motor inertia is at its lower bound, a thousandth of that
BY_DESIGN = ("stiffness", "motor_inertia")  # beside those of effects, parameters that have no natural bound

BEHIND_THE_GEAR = (
    "The motor inertias end at their lower bound: this torque was probably measured behind the gear (a joint "
    'torque sensor) or computed by the controller. If so, state torque = "joint" in measurements.toml; '
    "without that, stiffness and motor inertia mean nothing here."
)
JOINT_TORQUE = (
    "The torque is that of joint torque sensors, behind the gears: it shows neither motor inertia nor motor "
    'friction, so the model has neither. If it is the motors\' torque, state torque = "motor" in '
    "measurements.toml."
)
NOT_REFINED = (
    "The intervals cover noise and missing effects, not the observer's bias, which may be larger. Refining "
    "removes the bias (without --quick; Refine in the app)."
)
GRADED = {
    "stiffness": "stiffness",
    "motor_inertia": "motor inertia",
    "viscous_friction_sum": "viscous friction",
}


def assessment(result: ResultFields) -> str:
    """What is good, what is weak, what to do and to record next; empty without residuals."""
    if result.residual is None:
        return ""
    told = _errors(result.residual) if something_determined(result) else [_nothing(result.residual)]
    sentences = [*told, *_grades(result), *_advice(result, result.residual)]
    return " ".join(sentences)


def something_determined(result: ResultFields) -> bool:
    """Whether the data determine any value of the model; without one, its error says nothing of them."""
    own = (p for p in result.all_parameters if p.name not in INERTIAL_NAMES and not p.at_bound)
    return any(one.identifiable != "no" for one in (*own, *result.base_parameters))


def _nothing(residual: ResidualSummary) -> str:
    shares = [one for one in _shares(residual, residual.rms_validation or residual.rms) if math.isfinite(one)]
    of = percent_of(residual.units).removeprefix("% ")
    error = f", although the error is at most {percent(max(shares))} {of}" if shares else ""
    return f"Nothing is determined{error}: these data leave every value of the model open."


def _errors(residual: ResidualSummary) -> list[str]:
    error = residual.rms_validation or residual.rms
    shares = dict(zip(residual.joints, _shares(residual, error), strict=True))
    noise = dict(zip(residual.joints, residual.noise_share, strict=False))
    noisy = {joint: share for joint, share in noise.items() if share > GOOD_SHARE}
    good = {joint: share for joint, share in shares.items() if share <= GOOD_SHARE and joint not in noisy}
    weak = {joint: share for joint, share in shares.items() if share > GOOD_SHARE}
    kind, of = "held-out error" if residual.rms_validation else "error", percent_of(residual.units)[2:]
    out = []
    if noisy:
        out.append(f"Poor: {noise_text(noisy)}.")
    if good:
        count = "all joints" if len(good) == len(shares) else f"{len(good)} of {plural(len(shares), 'joint')}"
        out.append(f"Good: {kind} of {count}, at most {percent(max(good.values()))} {of}.")
    if weak:
        worst = sorted(weak.items(), key=lambda item: -item[1])
        out.append(f"Weak: {kind} of {listed([f'{joint} ({percent(share)})' for joint, share in worst])}.")
    if residual.rms_validation:
        pairs = zip(residual.joints, residual.rms, residual.rms_validation, residual.noise_floor, strict=True)
        worse = [
            j for j, fit, held, noise in pairs if held > WORSE_HELD_OUT * max(fit, FAR_FROM_NOISE * noise)
        ]
        if worse:
            text = "much larger than on the fitted groups; motion, payload or temperature may differ"
            out.append(f"{listed(worse)}: {text}.")
    return out


def _shares(residual: ResidualSummary, error: Sequence[float]) -> list[float]:
    """Errors relative to the torque; NaN where its spread is not known."""
    return normalised(error, residual.torque_spread or [math.nan] * len(error))


def _grades(result: ResultFields) -> list[str]:
    parts = [
        f"{title} {_count(p.identifiable == 'yes' for p in _named(result, name))}"
        for name, title in GRADED.items()
        if _named(result, name)
    ]
    combinations = _count(c.identifiable == "yes" for c in result.base_parameters)
    return [f"Determined: {listed([*parts, f'inertial combinations {combinations}'])}."]


def _advice(result: ResultFields, residual: ResidualSummary) -> list[str]:
    out = hints(result.all_parameters)
    if BEHIND_THE_GEAR in out:
        return out
    lacking = lacks_effects(result)
    out += [lacking] if lacking else []
    if not lacking and (reversals := only_reversals(result)):
        out.append(reversals)
    if not result.refined and result.iterations:
        out.append(NOT_REFINED)
    record = []
    if not residual.rms_validation:
        record.append("another motion as a held-out group (validation = true)")
    elastic = [*_named(result, "stiffness"), *_named(result, "motor_inertia")]
    undetermined = {p.joint for p in elastic if p.identifiable in ("no", "weak")}
    joints = [joint for joint in residual.joints if joint in undetermined]
    if joints:
        which = "all joints" if len(joints) == len(residual.joints) else listed(joints)
        record.append(f"faster reversals of {which}, with and without a payload of known mass")
    return [*out, f"Record {listed(record)}."] if record else out


def lacks_effects(result: ResultFields) -> str:
    """That the model lacks effects, for which its parameters stand in; empty if it does not.

    Samples that a reversal disturbs do not count: the torque of friction and backlash is unknown there.
    """
    residual = result.residual
    far = "" if residual is None else _far(residual, residual.rms_between_reversals or residual.rms)
    if not far:
        return ""
    return (
        f"{far}: the model lacks effects, and stiffness, inertia and friction stand in for them. Next: "
        "diagnose with --apply."
    )


def only_reversals(result: ResultFields) -> str:
    """That only reversals stay above the noise; empty if something else does, or nothing."""
    residual = result.residual
    if residual is None or not (far := _far(residual, residual.rms)) or lacks_effects(result):
        return ""
    return (
        f"{far}, but only around reversals and crossings of a gap, where the torque of friction and backlash "
        "is unknown."
    )


def _far(residual: ResidualSummary, rms: Sequence[float]) -> str:
    """The largest error that is not that of the sensors, and the noise; empty without one."""
    errors = JointErrors(rms, residual.torque_spread, residual.noise_floor, residual.units)
    for j in errors.order:
        noise, share = residual.noise_floor[j], errors.shares[j] / 100
        if errors.mark is not None and rms[j] > FAR_FROM_NOISE * noise > 0 and not share <= LEAST_SHARE:
            joint = residual.joints[j]
            noise_too = error_short(errors.mark, j)
            return f"The error of {joint} is {error_whole(errors, j)}, far above the noise of {noise_too}"
    return ""


def hints(parameters: Iterable[ParameterEstimate]) -> list[str]:
    """What the parameters say about the data, of an identification or a diagnosis."""
    parameters = list(parameters)
    told = [JOINT_TORQUE] if torque_side(parameters) == "joint" else []
    return [*told, *rigid_within(parameters), *at_bounds(parameters)]


def rigid_within(parameters: Iterable[ParameterEstimate]) -> list[str]:
    """Joints whose stiffness the data do not tell from infinity, each with what it is above."""
    found = {p.joint: p.rigid_above for p in parameters if p.joint and p.rigid_above is not None}
    if not found:
        return []
    above = listed([f"{joint} (K above {number(value, 2)} Nm/rad)" for joint, value in found.items()])
    names = ", ".join(f'"{joint}"' for joint in found)
    which = "it has" if len(found) == 1 else "they have"
    return [
        f"Rigid within what this motion shows, at 95 %: {above}. If {which} no elastic gear, state "
        f"rigid = [{names}] in [model] of measurements.toml: a soft spring may resemble other effects."
    ]


def at_bounds(parameters: Iterable[ParameterEstimate]) -> list[str]:
    """What values at their bounds say about the data; none without such values."""
    parameters = list(parameters)
    inertias = [p for p in parameters if p.name == "motor_inertia"]
    if inertias and sum(map(_without_motor, inertias)) >= NO_MOTOR * len(inertias):
        return [BEHIND_THE_GEAR]
    held = [p for p in parameters if p.at_bound and (p.name in BY_DESIGN or "." in p.name)]
    held = [p for p in held if p.rigid_above is None]  # told already
    if not held:
        return []
    names = [plain_name(p.name) + (f" of {p.joint}" if p.joint else "") for p in held]
    what = "its value is" if len(names) == 1 else "their values are"
    return [f"At the bound of what is possible: {listed(names)}; {what} no estimate."]


def torque_side(parameters: Iterable[ParameterEstimate]) -> TorqueSide:
    """What the torque of a fit is: that of the motors, or, without motor inertias, that behind the gears."""
    names = {p.name for p in parameters}
    return "joint" if "link_viscous_friction" in names and "motor_inertia" not in names else "motor"


def _without_motor(inertia: ParameterEstimate) -> bool:
    """Whether a motor inertia ended at its lower bound."""
    lowest = inertia.value <= AT_LOWEST * inertia.start
    return lowest or (inertia.at_bound and inertia.value < inertia.start)


def _named(result: ResultFields, name: str) -> Sequence[ParameterEstimate]:
    return [p for p in result.all_parameters if p.name == name]


def _count(determined: Iterable[bool]) -> str:
    """ "2 of 6"."""
    flags = list(determined)
    return f"{sum(flags)} of {len(flags)}"
