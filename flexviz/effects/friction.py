"""Reference and parameter shared by the friction effects."""

from __future__ import annotations

from flexviz.effects.terms import ParameterSpec

ARMSTRONG = (
    "Armstrong-Hélouvry, Dupont, Canudas de Wit: A survey of models, analysis tools and compensation methods "
    "for the control of machines with friction, Automatica 30(7), 1994"
)
SLIDING = ParameterSpec("coulomb", "Nm", 0.0, explanation="friction torque while moving", symbol="f_c")
