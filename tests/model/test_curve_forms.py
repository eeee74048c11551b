"""Simple laws behind a free curve."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from flexviz.model.effects import CurveForm, curve_points
from flexviz.model.effects import simple_form as form_of
from flexviz.model.effects.curve_forms import DIRECTIONS, FAMILIES

X = np.linspace(-1.0, 1.4, 40)
SPEED = np.linspace(0.0, 2.0, 40)
SIZES = {
    "constant": {"size": 2.0},
    "line": {"size": 1.0, "slope": 3.0},
    "bump": {"size": 4.0, "centre": 0.2, "width": 0.3},
    "exponential": {"size": 2.0, "rate": -1.5},
    "sine": {"size": 1.0, "order": 7.0, "phase": 0.4},
}
LAWS = {
    "constant": lambda x, v: v["size"] + 0 * x,
    "line": lambda x, v: v["size"] + v["slope"] * x,
    "bump": lambda x, v: v["size"] * np.exp(-(((x - v["centre"]) / v["width"]) ** 2)),
    "exponential": lambda x, v: v["size"] * np.exp(v["rate"] * x),
    "sine": lambda x, v: v["size"] * np.sin(v["order"] * x + v["phase"]),
}


def named(variable: str, x: np.ndarray, rows: list[np.ndarray], std: float = 0.02) -> CurveForm | None:
    points = curve_points(variable, x.tolist(), rows, [np.full(len(x), std)] * len(rows))
    return form_of(points, variable, "rad")


@pytest.mark.parametrize("kind", list(FAMILIES))
@pytest.mark.parametrize("direction", list(DIRECTIONS))
def test_a_law_is_recognised(kind: str, direction: str) -> None:
    rng = np.random.default_rng(3)
    clean = LAWS[kind](X, SIZES[kind])
    rows = [factor * clean + 0.02 * rng.normal(size=len(X)) for factor in DIRECTIONS[direction]]
    found = named("position", X, rows)
    assert found is not None and (found.kind, found.direction) == (kind, direction)
    assert found.explained > 0.95
    for name, value in SIZES[kind].items():
        assert found.values[name] == pytest.approx(value, rel=0.05, abs=0.03)


def test_what_no_simple_law_explains_has_no_name() -> None:
    rng = np.random.default_rng(1)
    assert named("position", X, [rng.normal(size=len(X))]) is None
    saw = np.array([(7 * x) % 1.0 for x in X]) * np.sign(np.sin(11 * X))
    assert named("position", X, [saw]) is None
    assert named("position", X, [0 * X]) is None
    assert named("position", X, [np.full(len(X), np.nan)]) is None


def test_a_law_beside_what_coulomb_friction_took() -> None:
    clean = LAWS["bump"](X, SIZES["bump"])
    found = named("position", X, [clean - 1.0, 1.0 - clean])
    assert found is not None and (found.kind, found.direction) == ("bump", "against")
    assert found.values["size"] == pytest.approx(4.0, rel=0.02)


def test_points_that_are_not_known_do_not_count() -> None:
    bump = LAWS["bump"](X, SIZES["bump"])
    std = np.where(X > 0.9, 3.0, 0.02)
    spoilt = np.where(X > 0.9, 2.0, bump)
    found = form_of(curve_points("position", X.tolist(), [spoilt], [std]), "position", "rad")
    assert (
        found is not None and found.kind == "bump" and found.values["centre"] == pytest.approx(0.2, abs=0.01)
    )


def test_of_velocity_both_directions_are_one_law() -> None:
    signed = np.linspace(-2.0, 2.0, 81)
    forward, backward = (
        np.where(side, 3.0 * sign, np.nan) for sign, side in ((1, signed > 0), (-1, signed < 0))
    )
    found = named("velocity", signed, [forward, backward])
    assert found is not None and (found.kind, found.direction) == ("constant", "against")
    viscous = 0.7 * signed  # the model's own viscous friction takes as much of the curve as it likes
    beside = named("velocity", signed, [forward + viscous, backward + viscous])
    assert beside is not None and beside.values["size"] == pytest.approx(3.0) and beside.kind == "constant"
    fading = 2.0 * np.exp(-2.0 * SPEED)
    stribeck = named("velocity", SPEED, [fading, -fading])
    assert stribeck is not None and stribeck.kind == "exponential" and stribeck.values["rate"] < 0


def test_what_is_proportional_to_velocity_does_not_count() -> None:
    """The model's viscous friction takes it: rows without their part along ±|v|, weighted."""
    rng = np.random.default_rng(0)
    std = rng.uniform(0.1, 0.4, (2, 40))
    points = curve_points("velocity", SPEED.tolist(), rng.normal(size=(2, 40)), std)
    signed = np.r_[SPEED, -SPEED] * points.weight
    counted = points.counted(rng.normal(size=(2, 3, 80)))
    assert np.abs(counted @ signed).max() < 1e-9 < np.abs(counted).max()
    np.testing.assert_allclose(points.counted(signed), 0.0, atol=1e-9)
    largest = np.abs(points.torque).max()
    np.testing.assert_allclose(1 / points.weight**2, std.ravel() ** 2 + (0.05 * largest) ** 2)
    assert points.backward.sum() == 40 and points.each_way and points.viscous
    alone = curve_points("position", X.tolist(), [X], [0 * X])
    assert not alone.backward.any() and not alone.each_way and not alone.viscous
    np.testing.assert_array_equal(alone.counted(X), X)


@pytest.mark.parametrize(
    ("kind", "inside", "outside"),
    [
        ("bump", [(0.0, 0.5), (2.0, 0.1), (4.0, 1.9)], [(-0.1, 0.5), (4.1, 0.5), (1.0, 0.03), (1.0, 2.1)]),
        ("exponential", [(0.3,), (-7.0,)], [(0.2,), (-0.2,), (8.0,)]),
        ("sine", [(1.6,), (30.0,)], [(1.4,), (-3.0,)]),
    ],
)
def test_forms_that_the_range_can_show(kind: str, inside: list[tuple], outside: list[tuple]) -> None:
    """Of a range of 4: a bump within it, at most half as wide; e-folds and turns that can be seen."""
    family = FAMILIES[kind]
    there = np.array(inside).T
    np.testing.assert_array_equal(family.possible(there, 0.0, 4.0), there)
    nearest = family.possible(np.array(outside).T, 0.0, 4.0)
    assert np.all(np.any(nearest != np.array(outside).T, axis=0))
    np.testing.assert_array_equal(family.possible(nearest, 0.0, 4.0), nearest)
    ends = np.array([values[[0, -1]] for values in family.grid(0.0, 4.0)])
    np.testing.assert_array_equal(family.possible(ends, 0.0, 4.0), ends)


def test_a_bump_and_a_constant_are_fitted_as_by_least_squares() -> None:
    """Where the best width is possible, no neighbour explains more (SciPy's Nelder–Mead finds the same)."""
    rng = np.random.default_rng(2)
    torque = 1.5 + LAWS["bump"](X, SIZES["bump"]) + 0.3 * rng.normal(size=len(X))
    points = curve_points("position", X.tolist(), [torque], [np.full(len(X), 0.3)])
    values, explained = FAMILIES["bump"].fit(points, (1.0, 1.0), True)

    def unexplained(inner: np.ndarray) -> float:
        columns = np.stack((np.exp(-(((X - inner[0]) / inner[1]) ** 2)), np.ones(len(X))), axis=1)
        left = np.linalg.lstsq(columns, torque, rcond=None)[1]
        return float(left[0] / np.sum(torque**2))

    best = minimize(unexplained, [0.0, 0.5], method="Nelder-Mead", options={"xatol": 1e-8, "fatol": 1e-12})
    assert 1 - explained == pytest.approx(best.fun, rel=1e-6)
    np.testing.assert_allclose([values["centre"], values["width"]], best.x, atol=1e-4)


def test_a_form_is_named_from_eight_points_on_and_never_beyond_doubt() -> None:
    for count, there in ((7, False), (8, True)):
        found = named("position", X[:count], [2.0 + 0 * X[:count]])
        assert (found is not None) == there
    assert found is not None and found.explained > 0.9999
    assert found.fact.text.endswith("(99 % of the curve)")
    rng = np.random.default_rng(5)
    noise = rng.normal(size=len(X))
    noise -= noise.mean()
    noise *= np.sqrt(len(X)) / np.linalg.norm(noise)
    for share in (0.78, 0.82):  # of the square of a constant with noise
        rows = [2.0 + 2.0 * np.sqrt(1 / share - 1) * noise]
        points = curve_points("position", X.tolist(), rows, [np.full(len(X), 1.0)])
        values, explained = FAMILIES["constant"].fit(points, (1.0, 1.0), False)
        assert explained == pytest.approx(share) and values["size"] == pytest.approx(2.0)
        assert (form_of(points, "position", "rad") is not None) == (share > 0.8)


def test_rules_of_direction() -> None:
    """A size is that of forward motion; of backward motion alone, that of backward motion."""
    rules = {"both": (1.0, 1.0), "against": (1.0, -1.0), "forward": (1.0, 0.0), "backward": (0.0, 1.0)}
    assert dict(DIRECTIONS) == rules


def test_a_form_is_said_in_words() -> None:
    def text(kind: str, direction: str, variable: str, unit: str, **values: float) -> str:
        return CurveForm(kind, direction, variable, unit, values, 0.853).fact.text

    assert (
        text("constant", "both", "position", "rad", size=2.0)
        == "a constant torque of 2 Nm (85 % of the curve)"
    )
    assert text("constant", "against", "load", "Nm", size=-2.0).startswith(
        "a step of −2 Nm where the motion rev"
    )
    spring = text("line", "both", "position", "rad", size=1.0, slope=3.0)
    assert spring == "a linear spring of 3 Nm/rad, 1 Nm at zero (85 % of the curve)"
    line = text("line", "forward", "position", "rad", size=1.0, slope=3.0)
    assert line.startswith("a straight line of 3 Nm per rad, 1 Nm at zero, in forward motion only")
    assert text("line", "both", "time", "s", size=1.0, slope=3.0).startswith("a straight line of 3 Nm per s")
    grows = text("exponential", "against", "load", "Nm", size=1.0, rate=0.25)
    assert grows.startswith(
        "an exponential of 1 Nm at zero that grows by a factor of e every 4 Nm, against the m"
    )
    assert "falls by a factor of e every 4 Nm" in text(
        "exponential", "both", "load", "Nm", size=1.0, rate=-0.25
    )
    assert text("sine", "backward", "time", "s", size=1.0, order=7.0).startswith(
        "a sine of 1 Nm with 7 rad per s,"
    )
