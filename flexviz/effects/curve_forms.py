"""Simple laws behind a free curve: constant, line, bump, exponential, sine, each with a rule of direction.

A form is fitted to points of the curve by least squares, weighted by their uncertainty: its size in closed
form, its place and width from a grid, then refined.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from flexviz._scipy import sp
from flexviz.effects.terms import Array

MIN_EXPLAINED = 0.8  # of the curve's weighted square; a form that explains less is not named
PRICE = 0.02  # share that every further parameter has to explain
ERROR_FLOOR = 0.05  # of the largest torque: uncertainty that all points have at least
LEAST_TURNS, LEAST_DECAY, MOST_DECAY = 1.0, 1.0, 30.0  # of a sine and an exponential over the range
REFINED = 3  # best points of the grid that are refined
DIRECTIONS: Mapping[str, tuple[float, float]] = {
    "both": (1.0, 1.0),
    "against": (1.0, -1.0),
    "forward": (1.0, 0.0),
    "backward": (0.0, 1.0),
}
"""Rule of direction → factor of forward and of backward motion."""


@dataclass(frozen=True)
class CurvePoints:
    """Points of a curve, shape (N,) each.

    Attributes:
        x: the variable; of velocity the speed.
        backward: whether the point belongs to backward motion.
        torque, weight: [Nm], [1/Nm].
        each_way: the curve depends on the direction.
        viscous: what is proportional to the velocity does not count: the model's viscous friction takes it.
    """

    x: Array
    backward: Array
    torque: Array
    weight: Array
    each_way: bool
    viscous: bool

    def counted(self, weighted: Array) -> Array:
        """Weighted columns (N,) or (N, K) without what viscous friction takes."""
        if not self.viscous:
            return weighted
        own = np.where(self.backward, -self.x, self.x) * self.weight
        return weighted - np.multiply.outer(own, own @ weighted / (own @ own))


@dataclass(frozen=True)
class CurveForm:
    """A simple law that a curve resembles.

    Attributes:
        kind: "constant", "line", "bump", "exponential" or "sine".
        direction: rule of direction, one of DIRECTIONS.
        variable, unit: of the curve.
        values: parameter → value: "size" [Nm], "slope", "centre", "width", "rate", "order", "phase".
        explained: share of the curve's weighted square.
    """

    kind: str
    direction: str
    variable: str
    unit: str
    values: Mapping[str, float]
    explained: float

    @property
    def text(self) -> str:
        """ "a bump of 14.9 Nm at −0.02 rad, 0.18 rad wide, against the motion (97 % of the curve)"."""
        v = {name: f"{value:.3g}".replace("-", "−") for name, value in self.values.items()}
        step, rate = self.direction == "against", self.values.get("rate", 1.0)
        text = {
            "constant": f"a step of {v['size']} Nm where the motion reverses"
            if step
            else f"a constant torque of {v['size']} Nm",
            "line": f"a straight line of {v.get('slope')} Nm per {self.unit}, {v['size']} Nm at zero",
            "bump": f"a bump of {v['size']} Nm at {v.get('centre')} {self.unit}, "
            f"{v.get('width')} {self.unit} wide",
            "exponential": f"an exponential of {v['size']} Nm at zero that "
            f"{'grows' if rate > 0 else 'falls'} by a factor of e every {1 / abs(rate):.3g} {self.unit}",
            "sine": f"a sine of {v['size']} Nm with {v.get('order')} rad per {self.unit}",
        }[self.kind]
        if self.kind == "line" and self.variable == "position" and self.direction == "both":
            text = f"a linear spring of {v['slope']} Nm/rad, {v['size']} Nm at zero"
        way = {"both": "", "against": ", against the motion"}.get(
            self.direction, f", in {self.direction} motion only"
        )
        way = "" if self.kind == "constant" and step else way
        return f"{text}{way} ({min(100 * self.explained, 99):.0f} % of the curve)"


def curve_points(
    variable: str, at: Sequence[float | None], value: Iterable[Iterable[float | None]],
    std: Iterable[Iterable[float | None]],
) -> CurvePoints:  # fmt: skip
    """Points of a curve given at `at` by one row per direction; what is not finite is left out."""
    rows = np.array([list(row) for row in value], float)
    errors = np.array([list(row) for row in std], float)
    x = np.tile(np.array(at, float), (len(rows), 1))
    backward = np.repeat(np.arange(len(rows))[:, None] == 1, x.shape[1], axis=1)
    if variable == "velocity":
        x = np.abs(x)
    good = np.isfinite(rows) & np.isfinite(errors)
    largest = float(np.abs(rows[good]).max(initial=1e-12))
    weight = 1 / np.hypot(errors[good], ERROR_FLOOR * largest)
    return CurvePoints(x[good], backward[good], rows[good], weight, len(rows) == 2, variable == "velocity")


def simple_form(points: CurvePoints, variable: str, unit: str) -> CurveForm | None:
    """The simple law that explains most of a curve, or None if none explains enough."""
    if len(points.x) < 8 or not points.torque.any():
        return None
    best: CurveForm | None = None
    most = -np.inf
    for direction in DIRECTIONS if points.each_way else ("both",):
        for (kind, family), shifted in product(FAMILIES.items(), (False, True)):
            if shifted and kind in ("constant", "line"):
                continue
            found = family.fit(points, DIRECTIONS[direction], shifted)
            if found is None:
                continue
            values, explained = found
            worth = explained - PRICE * (len(values) - 1 + shifted)
            if worth > most:
                best, most = CurveForm(kind, direction, variable, unit, values, explained), worth
    return best if best is not None and best.explained >= MIN_EXPLAINED else None


@dataclass(frozen=True)
class FormFamily:
    """Curves of one kind.

    Attributes:
        basis: x (N,) and the nonlinear parameters → columns (K, N), whose sizes are free.
        grid: lowest and highest x → values to try of each nonlinear parameter.
        possible: nonlinear parameters, lowest and highest x → whether they make sense.
        named: sizes (K,) and nonlinear parameters → the parameters by name.
    """

    basis: Callable[[Array, Array], Array]
    grid: Callable[[float, float], tuple[Array, ...]]
    possible: Callable[[Array, float, float], bool]
    named: Callable[[Array, Array], dict[str, float]]

    def fit(
        self, points: CurvePoints, factors: tuple[float, float], shifted: bool
    ) -> tuple[dict[str, float], float] | None:
        """Parameters and explained share of the best curve of the family, or None.

        With `shifted` beside a constant, in each direction of its sign, that other effects may have taken:
        Coulomb friction in the model leaves a curve of position known up to a step.
        """
        low, high = float(points.x.min()), float(points.x.max())
        factor = np.where(points.backward, factors[1], factors[0]) * points.weight
        constant = np.where(points.backward, -1.0, 1.0)[None] * points.weight
        wanted = points.counted(points.torque * points.weight)

        def project(inner: Array) -> tuple[float, Array]:
            rows = self.basis(points.x, inner) * factor
            columns = points.counted(np.vstack((rows, constant)[: 1 + shifted]).T)
            sizes = np.asarray(np.linalg.lstsq(columns, wanted, rcond=1e-9)[0], float)
            return float(np.sum((wanted - columns @ sizes) ** 2)), sizes[: len(rows)]

        def cost(inner: Array) -> float:
            return project(inner)[0] if self.possible(inner, low, high) else np.inf

        starts = sorted((np.array(p) for p in product(*self.grid(low, high))), key=cost)[:REFINED]
        ends = [self._refined(cost, start) for start in starts if np.isfinite(cost(start))]
        if not ends:
            return None
        end = min(ends, key=cost)
        left, sizes = project(end)
        return self.named(sizes, end), 1 - left / float(np.sum(wanted**2))

    @staticmethod
    def _refined(cost: Callable[[Array], float], start: Array) -> Array:
        if not len(start):
            return start
        options = {"maxiter": 120, "xatol": 1e-6}
        found = sp.optimize.minimize(cost, start, method="Nelder-Mead", options=options)
        return np.asarray(found.x, float)


def _wave(sizes: Array, inner: Array) -> dict[str, float]:
    size, phase = float(np.hypot(*sizes)), float(np.arctan2(sizes[1], sizes[0]))
    return {"size": size, "order": float(inner[0]), "phase": phase}


def _orders(low: float, high: float) -> tuple[Array, ...]:
    turn = 2 * np.pi / max(high - low, 1e-9)
    return (turn * np.arange(LEAST_TURNS, 13.0, 0.25),)


def _always(inner: Array, low: float, high: float) -> bool:
    return True


FAMILIES: Mapping[str, FormFamily] = {
    "constant": FormFamily(
        lambda x, inner: np.ones((1, len(x))),
        lambda low, high: (),
        _always,
        lambda s, i: {"size": float(s[0])},
    ),
    "line": FormFamily(
        lambda x, inner: np.stack((x, np.ones(len(x)))),
        lambda low, high: (),
        _always,
        lambda s, i: {"size": float(s[1]), "slope": float(s[0])},
    ),
    "bump": FormFamily(
        lambda x, inner: np.exp(-(((x - inner[0]) / inner[1]) ** 2))[None],
        lambda low, high: (np.linspace(low, high, 25), (high - low) * np.array([0.04, 0.08, 0.16, 0.32])),
        lambda i, low, high: low <= i[0] <= high and 0.01 < i[1] / (high - low) < 0.5,
        lambda s, i: {"size": float(s[0]), "centre": float(i[0]), "width": float(i[1])},
    ),
    "exponential": FormFamily(
        lambda x, inner: np.exp(inner[0] * x)[None],
        lambda low, high: (np.array([-16.0, -8, -4, -2, -1.2, 1.2, 2, 4, 8, 16]) / (high - low),),
        lambda i, low, high: LEAST_DECAY < abs(i[0]) * (high - low) < MOST_DECAY,
        lambda s, i: {"size": float(s[0]), "rate": float(i[0])},
    ),
    "sine": FormFamily(
        lambda x, inner: np.stack((np.sin(inner[0] * x), np.cos(inner[0] * x))),
        _orders,
        lambda i, low, high: i[0] * (high - low) >= 2 * np.pi * LEAST_TURNS * 0.95,
        _wave,
    ),
}
