"""Observers that cannot be used."""

from __future__ import annotations

from flexviz.base.facts import Fact
from flexviz.content.wording.facts import says


@says("unusable-gains")
def unusable_gains(fact: Fact) -> str:
    """Gains of an unstable observer, or of another number."""
    values = fact.values
    if "given" in values:
        return f"{values['given']} gains were given, expected {values['expected']}: β1 … β6"
    if "number" in values:
        gain = f"β{values['number']} = {values['gain']:g}"
        return f"{gain} makes the observer unstable: every gain is to be positive and finite"
    real, imaginary = values["pole"]
    pole = f"{real:.3g} ± {imaginary:.3g}i" if imaginary else f"{real:.3g}"
    return (
        f"these gains make the observer unstable: pole at {pole} rad/s, expected all poles left of the "
        "imaginary axis"
    )
