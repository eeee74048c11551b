"""How an identification ended, and what keeps it from more."""

from __future__ import annotations

from flexviz.base.facts import Fact
from flexviz.base.spelling import listed, plural
from flexviz.base.units import unit_of_all
from flexviz.content.wording.errors import percent
from flexviz.content.wording.facts import says
from flexviz.content.wording.numbers import plain_name

ENDS = {
    "converged": "converged",
    "not-converged": "did not converge; the values are where the solver stopped",
    "fit-stopped": "stopped; the values are those of the last step",
    "values-given": "values as given; they were not fitted with this observer",
    "converged-in-motion": (
        "converged in the band of the motion: the model errs by more than the sensors, and each joint is "
        "weighted by what the model leaves"
    ),
    "observer-lags": (
        "the residual is far above the noise: this observer's own error is not in the intervals"
    ),
}


@says(*ENDS)
def end(fact: Fact) -> str:
    """Ends that have no numbers."""
    return ENDS[fact.kind]


@says("refined")
def refined(fact: Fact) -> str:
    """A refinement to the noise, or despite a model error."""
    if added := fact.values["model_error"]:
        shown = ", ".join(f"{value:.2g}" for value in added)
        unit = unit_of_all(fact.values.get("units", ()))
        return (
            f"refined; the model errs more than the sensors, a model error ({shown} {unit}) was allowed for"
        )
    chi_square = fact.values["chi_square"]
    return f"refined; whitened residual {chi_square:.3g} per sample (1 = measurement noise alone)"


@says("joint-not-fitted")
def joint_not_fitted(fact: Fact) -> str:
    """A joint that keeps a fit from ending, and what is wrong with it."""
    values, why = fact.values, list[str]()
    if bound := values["at_bound"]:
        names = listed([plain_name(name) for name in bound])
        why.append(f"its {names} ended at the bound of what is possible")
    if unknown := values["undetermined"]:
        why.append(f"the data do not determine its {listed([plain_name(name) for name in unknown])}")
    if share := values["share"]:
        why.append(f"its error is {percent(share)} of its torque")
    if moves := values["moves"]:
        why.append(f"its {plain_name(moves)} still moves")
    return f"{fact.joints[0]} cannot be fitted, because " + listed(
        why or ["its residual is the furthest above the noise"]
    )


@says("groups-not-used")
def groups_not_used(fact: Fact) -> str:
    """Groups that are too short for the observer."""
    names = f"{plural(len(fact.groups), 'group')} not used: {listed(fact.groups)}"
    return f"{names}, gaps leave no stretch longer than the observer's transients"


@says("holds-used")
def holds_used(fact: Fact) -> str:
    """Static tests, and joints that the motion contradicts."""
    text = f"with {plural(fact.values['count'], 'hold')} of static tests"
    if not fact.joints:
        return text
    apart = listed(fact.joints)
    return f"{text}, whose stiffness of {apart} the motion contradicts: the model lacks something"
