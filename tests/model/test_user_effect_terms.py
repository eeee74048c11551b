"""Checks of user-defined effects that are no plain law: terms of their own, and laws of the joint."""

from __future__ import annotations

from pathlib import Path

import pytest

from flexviz.base.errors import InputError
from flexviz.model.effects import forget_effects, load_effects
from tests.model.test_user_effects import GOOD, LAW, file_with, library

__all__ = ["library"]
TERMS = (
    GOOD.replace("LinearEffect", "Effect, Terms")
    .replace("Effect, Terms)", "Effect)")
    .replace(
        "    def columns(self, motion):\n        return motion.velocity[np.newaxis]\n",
        """\
    def terms(self, context, place, values):
        column = context.theta(place.own_joint)[1:4, :, None]
        return RETURNED
""",
    )
)


@pytest.mark.parametrize(
    ("returned", "more", "message"),
    [
        ('Terms("torque", (0,), values[0] * column, column[None])', "", None),
        ('Terms("torque", (0,), values[0] * column, 2 * column[None])', "", "line 18: .*∂u/∂size differs"),
        (
            'Terms("torque", (0,), values[0] * column[:1], column[None])',
            "",
            r"line 18: .*value has shape \(1, ",
        ),
        ('Terms("residual", (0,), values[0] * column[:1], column[None, :1])', "", None),
        (
            'Terms("torque", (0, 1), values[0] * column, column[None])',
            "",
            r"line 18: .* expected \(3, 3001, 2",
        ),
        ("column", "", "line 18: .* terms does not return Terms"),
        (
            'Terms("gravity", (0,), values[0] * column[:1], column[None, :1])',
            "",
            'belong together; found the entries "gravity" and "torque"',
        ),
        (
            'Terms("residual", (0,), values[0] * column[:1], column[None, :1])',
            "gravity = lambda self, values, stated: np.array([0.0, 0.0, -9.0])",
            'belong together; found the entries "residual" and "torque"',
        ),
        (
            'Terms("torque", (0,), values[0]**2 * column, 2 * values[0] * column[None])',
            "linear = True",
            "not linear",
        ),
        (
            'Terms("torque", (0,), values[0] * column, column[None])',
            "simulation = lambda self, values: lambda at: 0.0",
            "only laws of motor, link or joint",
        ),
    ],
)
def test_terms_are_checked(returned: str, more: str, message: str | None, tmp_path: Path) -> None:
    text = TERMS.replace("RETURNED", returned).replace("    def terms", f"    {more}\n\n    def terms")
    path = file_with(tmp_path, text)
    if message is None:
        assert load_effects(path)[0].name == "my_friction"
        return
    with pytest.raises(InputError, match=message):
        load_effects(path)


def test_a_joint_law_is_simulated_as_what_the_link_loses(tmp_path: Path) -> None:
    """A spring that is stiffer by `size`: the joint carries more at the same deflection."""
    law = LAW.replace('"motor"', '"joint"').replace("    def law", "    state = True\n\n    def law")
    law = law.replace("lower=0.0),)", "lower=0.0),)\n    example = (90.0,)")
    law = law.replace(
        "u = values[0] * motion.velocity", "k, p, s = motion.stiffness, values[0], motion.torque"
    )
    law = law.replace("return u, SLOPES", "return s / k - s / (k + p), (s / (k + p) ** 2)[np.newaxis]")
    for size, message in (("1.0", None), ("1.1", "line 2[0-9]: .* simulation and u differ")):
        forget_effects()
        torque = f"{size} * values[0] * (at.theta - at.q)"
        path = file_with(tmp_path, law.replace("SIGN * values[0] * at.theta_velocity", torque))
        if message is None:
            assert load_effects(path)[0].where == "joint"
        else:
            with pytest.raises(InputError, match=message):
                load_effects(path)
