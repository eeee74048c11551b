"""A user-defined effect in its file, drafted from the simple law that a free curve resembles."""

from __future__ import annotations

import re
from dataclasses import dataclass

from flexviz.model.effects.curve_forms import CurveForm

VARIABLES = {"position": "position", "velocity": "velocity", "load": "torque", "time": "time"}
STATES = {"position": "at.theta", "velocity": "abs(at.theta_velocity)", "load": "at.load", "time": "at.time"}
SYMBOLS = {"position": "θ", "velocity": "|θ̇|", "load": "τ_j", "time": "t"}
FACTORS = {
    "both": ("np.ones(len(x))", "1.0", ""),
    "against": ("smooth_sign(velocity)", "sign", " · sign(θ̇)"),
    "forward": ("0.5 * (1.0 + smooth_sign(velocity))", "0.5 * (1.0 + sign)", " for θ̇ > 0"),
    "backward": ("0.5 * (1.0 - smooth_sign(velocity))", "0.5 * (1.0 - sign)", " for θ̇ < 0"),
}


@dataclass(frozen=True)
class LawTemplate:
    """Code of a law of one variable x."""

    # title, equation: texts; {x} is the variable's symbol
    title: str
    equation: str
    names: dict[str, str]  # parameter → unit, where {u} is the variable's; the first is the size
    law: str  # expression of x and the parameters, with np; slopes: ∂/∂(each parameter)
    slopes: tuple[str, ...]
    bounds: dict[str, str]  # parameter → its bounds as arguments of ParameterSpec
    grid: dict[str, str]  # parameter → factors of its value, or offsets in widths for "centre", to start from


BUMP = "np.exp(-(((x - centre) / width) ** 2))"
ONE = "1.0 + 0.0 * x"
LAWS = {
    "constant": LawTemplate("Constant torque", "p", {"size": "Nm"}, "size + 0.0 * x", (ONE,), {}, {}),
    "line": LawTemplate(
        "Line", "k {x} + p", {"size": "Nm", "slope": "Nm/{u}"}, "size + slope * x", (ONE, "x"), {}, {}
    ),
    "bump": LawTemplate(
        "Bump", "p exp(−(({x} − c)/w)²)", {"size": "Nm", "centre": "{u}", "width": "{u}"}, f"size * {BUMP}",
        (
            BUMP,
            f"size * {BUMP} * 2.0 * (x - centre) / width**2",
            f"size * {BUMP} * 2.0 * (x - centre) ** 2 / width**3",
        ),
        {"width": "lower={least:.3g}, "},
        {"centre": "({centre:.6g} - {width:.3g}, {centre:.6g}, {centre:.6g} + {width:.3g})",
         "width": "(0.5 * {width:.6g}, {width:.6g}, 2.0 * {width:.6g})"},
    ),
    "exponential": LawTemplate(
        "Exponential", "p exp(r {x})", {"size": "Nm", "rate": "1/{u}"}, "size * np.exp(rate * x)",
        ("np.exp(rate * x)", "size * x * np.exp(rate * x)"), {},
        {"rate": "(0.5 * {rate:.6g}, {rate:.6g}, 1.5 * {rate:.6g})"},
    ),
    "sine": LawTemplate(
        "Sine", "p sin(n {x} + φ)", {"size": "Nm", "order": "rad/{u}", "phase": "rad"},
        "size * np.sin(order * x + phase)",
        (
            "np.sin(order * x + phase)",
            "size * x * np.cos(order * x + phase)",
            "size * np.cos(order * x + phase)",
        ),
        {"order": "lower=0.0, "},
        {"order": "(0.9 * {order:.6g}, {order:.6g}, 1.1 * {order:.6g})",
         "phase": "({phase:.3g}, {phase:.3g} + 1.57)"},
    ),
}  # fmt: skip
FILE = '''"""Drafted by flexviz from a free curve: {text}.

Check the law, give it its name, texts and reference; then: --effects-from this file.
"""

from math import tanh

import numpy as np

from flexviz.model.effects import JointMotion, JointState, LawEffect, ParameterSpec, smooth_sign


class {class_name}(LawEffect):
    """{title}, as a free curve of {variable} on {joint} suggests."""

    name = "{name}"
    title = "{title}"
    where = "{where}"
    explanation = "A torque that depends on the {variable} as a free curve has shown it: a draft."
    equation = "u = {equation}"
    signature = "The residual of {joint} follows the {variable} in this form."
    confirm = "Other motions and payloads: a law holds there, too, a coincidence does not."
    reference = "none yet: drafted from the set {set_name}"
    parameters = (
{parameters}    )
    linear = {linear}
    smooth = {smooth}
    state = {state}
    grid = {grid}
    example = ({example},)

    def law(self, motion: JointMotion, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """u, shape (N,), and its slopes by the parameters, shape (P, N)."""
        {unpacked} = values
        x, velocity = {x}, motion.{velocity}
        factor = {factor}
        u = {law}
        slopes = np.stack((
{slopes}        ))
        return factor * u, factor * slopes

    def simulation(self, values: np.ndarray):
        """The same for the simulator: the torque at one instant."""
        {unpacked} = values.tolist()

        def torque(at: JointState) -> float:
            x, sign = {state_x}, tanh(at.{state_velocity} / 0.005)
            return float(({law}) * {state_factor})

        return torque
'''


def draft_effect(form: CurveForm, joint: str, set_name: str, on_link: bool = False) -> str:
    """The text of an effect file with the law of a form; it passes the checks and can be fitted as it is."""
    law, link = LAWS[form.kind], "link_" if on_link else ""
    joint, set_name = (re.sub(r"[^\w. -]", "_", text) for text in (joint, set_name))
    unit = form.unit
    vector_factor, state_factor, suffix = FACTORS[form.direction]
    symbol = SYMBOLS[form.variable].replace("θ", "q") if on_link else SYMBOLS[form.variable]
    variable = VARIABLES[form.variable]
    moves = form.variable in ("position", "velocity")
    x = f"motion.{link if moves else ''}{variable}"
    state_x = STATES[form.variable].replace("theta", "q") if on_link else STATES[form.variable]
    least = abs(form.values.get("width", 1.0)) / 20
    bounds = {name: text.format(least=least) for name, text in law.bounds.items()}
    units = {name: text.format(u=unit) for name, text in law.names.items()}
    numbers = dict(form.values) | {"width": abs(form.values.get("width", 1.0))}
    grid = ", ".join(f'"{name}": {text.format(**numbers)}' for name, text in law.grid.items())
    name = f"{form.kind}_of_{form.variable}"
    return FILE.format(
        text=form.text,
        class_name="".join(part.capitalize() for part in name.split("_")),
        name=name,
        title=f"{law.title} of {form.variable} (draft)",
        variable=form.variable,
        joint=joint,
        set_name=set_name,
        where="link" if on_link else "motor",
        equation=(law.equation.format(x=symbol) + suffix).replace("θ̇", "q̇" if on_link else "θ̇"),
        parameters="".join(
            f'        ParameterSpec("{key}", "{text}", {bounds.get(key, "")}explanation="{key}"),\n'
            for key, text in units.items()
        ),
        linear=not law.grid,
        smooth=form.direction == "both",
        state=on_link or form.variable == "load",
        grid="{" + grid + "}",
        example=", ".join(f"{numbers[key]:.6g}" for key in units),
        unpacked=", ".join(units) + ("," if len(units) == 1 else ""),
        x=f"np.abs({x})" if form.variable == "velocity" else x,
        velocity=f"{link}velocity",
        factor=vector_factor,
        law=law.law,
        slopes="".join(f"            {slope},\n" for slope in law.slopes),
        state_x=state_x,
        state_velocity="q_velocity" if on_link else "theta_velocity",
        state_factor=state_factor,
    )
