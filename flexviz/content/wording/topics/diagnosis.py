"""What accompanies a verdict: errors, places, curves, and what does not count."""

from __future__ import annotations

from flexviz.base.facts import Fact
from flexviz.base.spelling import listed, number, plural
from flexviz.content.records import JointErrors
from flexviz.content.wording.errors import error_whole, left_text, percent
from flexviz.content.wording.facts import says
from flexviz.content.wording.numbers import interval, plain_name, unit_text
from flexviz.model.effects import EFFECTS

PLACES = {
    "motor": "on the motor side of {}",
    "transmission": "in the transmission of {}",
    "link": "on the link side of {}",
    None: "at {}",
}
ANY_VALUE = "static friction can take any value up to its limit"
NO_CURVE = {
    "verdict": 'the verdict is "{verdict}", a free curve is for "unknown"',
    "has-one": "the model has one on {joint}, and another one would explain nothing",
    "stopped": "the diagnosis was stopped before it computed a free curve",
    "no-such-curve": "what is left on {joint} follows {variable}, for which there is no free curve",
    "uncertain": "the free curve of {joint} explains {share} ± {error} of what is left: perhaps nothing",
    "has-this-one": "the model has a free curve of {variable} on {joint} already",
}


def errors_of(fact: Fact, name: str = "rms") -> JointErrors:
    """The errors that a fact carries under a name, in relation to the torque's spread."""
    return JointErrors(fact.values[name], fact.values["spread"], (), fact.values["units"])


@says("model-error")
def model_error(fact: Fact) -> str:
    """The error that all models leave."""
    left = errors_of(fact)
    sizes = ", ".join(f"{joint} {error_whole(left, j)}" for j, joint in enumerate(fact.joints))
    return (
        "no model reaches the noise, so an effect was added only if it also predicts the held-out groups "
        f"better; torque error left in the model: {sizes}"
    )


@says("pulses")
def pulses(fact: Fact) -> str:
    """The error of a joint at reversals and gap crossings."""
    kind = "fitted" if fact.values["fitted"] else "held-out"
    return (
        f"the error of {fact.joints[0]}, {error_whole(errors_of(fact), 0)} in the {kind} groups, arises at "
        "motion reversals and backlash crossings: it includes their unknown torque, which the fit treats as "
        "pulses of unknown size"
    )


@says("unexplained")
def unexplained(fact: Fact) -> str:
    """What the last model leaves."""
    return f"unexplained residual: {left_text(fact.joints, errors_of(fact))}"


@says("free-curve")
def free_curve(fact: Fact) -> str:
    """A curve that explains some of the residual."""
    values = fact.values
    sides = " and the direction of motion" if values["directions"] > 1 else ""
    text = (
        f"a free curve against the {values['variable']}{sides} of {fact.joints[0]} explains "
        f"{100 * values['explained']:.0f} % of its residual: not physics"
    )
    return text + (f"; its form is that of {values['form']}" if values["form"] else "")


@says("stopgap")
def stopgap(fact: Fact) -> str:
    """Free curves in the model."""
    own = ", ".join(fact.values["effects"])
    return f"not physics, but in the model: {own}; it stands for a law that is still unknown"


@says("bandwidth")
def bandwidth(fact: Fact) -> str:
    """A residual or a parameter that changes with the observer's bandwidth."""
    values = fact.values
    if "parameter" not in values:
        low, high = values["bandwidths"]
        change = f"{values['change']:.3g} {values.get('unit', 'Nm')}"
        return (
            f"{fact.joints[0]}: the residual changes by up to {change} between bandwidths "
            f"of {low:.3g} and {high:.3g} rad/s: part of it is observer error, not physics"
        )
    place = f" ({', '.join(values['places'])})" if values["places"] else ""
    return (
        f"{values['parameter']}{place} changes with the bandwidth between {values['least']:.4g} and "
        f"{values['most']:.4g} {values['unit']}, {values['moved']:.1f} standard errors: not to be trusted"
    )


@says("standstill")
def standstill(fact: Fact) -> str:
    """Joints whose rest does not count."""
    still, starts = fact.joints, fact.values["starts"]

    def named(some: tuple[str, ...]) -> str:
        return "all joints" if len(some) == fact.values["of"] > 1 else listed(some)

    also = f" and the first {fact.values['start_angle']:g} rad after it" if starts else ""
    also += f" ({named(starts)})" if starts and tuple(starts) != tuple(still) else ""
    return f"standstill of {named(still)}{also} counts in no error: {ANY_VALUE} there"


@says("groups-at-rest")
def groups_at_rest(fact: Fact) -> str:
    """Held-out groups that judge nothing."""
    return (
        f"held-out {plural(len(fact.groups), 'group')} {listed(fact.groups)} counts in no error: the robot "
        f"stands still, where {ANY_VALUE}"
    )


@says("drowned")
def drowned(fact: Fact) -> str:
    """Joints whose noise exceeds their torque."""
    return f"the estimated noise is larger than the torque of {listed(fact.joints)}, so nothing can be told"


@says("changing")
def changing(fact: Fact) -> str:
    """A size of an effect that is not constant."""
    values = fact.values
    start, end, place = values["start"], values["end"], values["place"]
    grows = "grows" if abs(end) > abs(start) else "falls"
    title = EFFECTS[values["effect"]].title.lower() + (f" of {place}" if place else "")
    to = f"{end:.2g} {unit_text(values['unit'])}".rstrip()
    how = f"{'changes' if start * end < 0 else grows} from about {start:.2g} to {to}"
    when = "during a recording" if values["along"] == "time" else "with the torque that the joint transmits"
    return (
        f"{plain_name(values['parameter'])} of the {title} is not constant: it {how} {when}, which this "
        "effect cannot describe"
    )


@says("place")
def place(fact: Fact) -> str:
    """Where an unmodelled torque acts."""
    values = fact.values
    given = f"acts {PLACES[values['side']].format(fact.joints[0])}: with an arbitrary torque there,"
    text = f"most of what is missing {given} little of the error is left"
    if values["complete"]:
        text = f"what is missing {given} all joints agree with the noise"
    hertz = values["hertz"]
    return text + (f"; it is a vibration of {hertz:.3g} Hz, whatever the robot does" if hertz else "")


@says("unbiased")
def unbiased(fact: Fact) -> str:
    """Parameters that an unmodelled torque has biased."""
    shown = (
        f"{plain_name(name)} of {joint} {' ± '.join(interval(value, std))} {unit} instead of "
        f"{number(biased, 4)}"
        for name, joint, value, std, unit, biased in fact.values["parameters"]
    )
    return f"given this arbitrary torque: {', '.join(shown)}"


@says("no-free-curve")
def no_free_curve(fact: Fact) -> str:
    """Why no free curve can be added."""
    values = dict(fact.values)
    values |= {name: percent(values[name]) for name in ("share", "error") if name in values}
    return NO_CURVE[values.pop("why")].format(joint="".join(fact.joints), **values)
