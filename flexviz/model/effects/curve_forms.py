"""Simple laws behind a free curve: constant, line, bump, exponential, sine, each with a rule of direction.

A form is fitted to points of the curve by least squares, weighted by their uncertainty: its size in closed
form, its place and width from a grid, then refined by Gauss–Newton steps of the residual that the best size
leaves (variable projection; Golub, Pereyra: The differentiation of pseudo-inverses and nonlinear least
squares problems whose variables separate, SIAM J. Numer. Anal. 10, 1973).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from flexviz.model.effects.terms import Array

MIN_EXPLAINED = 0.8  # of the curve's weighted square; a form that explains less is not named
PRICE = 0.02  # share that every further parameter has to explain
ERROR_FLOOR = 0.05  # of the largest torque: uncertainty that all points have at least
LEAST_TURNS, LEAST_DECAY, MOST_DECAY = 1.0, 1.0, 30.0  # of a sine and an exponential over the range
LEAST_WIDTH, MOST_WIDTH = 0.01, 0.5  # of a bump, share of the range
REFINED, STEPS = 3, 30  # best points of the grid that are refined, and by how many steps at most
LENGTHS = np.array([0.0, 0.05, 0.2, 0.5, 1.0])  # of a step that are tried
SETTLED = 1e-8  # relative fall of the weighted square that ends the steps
RANK = 1e-9  # relative square of what other rows leave of one below which it does not count
DIRECTIONS: Mapping[str, tuple[float, float]] = {
    "both": (1.0, 1.0),
    "against": (1.0, -1.0),
    "forward": (1.0, 0.0),
    "backward": (0.0, 1.0),
}
"""Rule of direction → factor of forward and of backward motion."""


@dataclass(frozen=True)
class CurvePoints:
    """Points of a curve, shape (N,) each."""

    x: Array  # the variable; of velocity the speed
    backward: Array  # whether the point belongs to backward motion
    # torque, weight: [Nm], [1/Nm]
    torque: Array
    weight: Array
    each_way: bool  # the curve depends on the direction
    # what is proportional to the velocity does not count: the model's viscous friction takes it
    viscous: bool

    def counted(self, weighted: Array) -> Array:
        """Weighted rows (…, N) without what viscous friction takes."""
        if not self.viscous:
            return weighted
        own = np.where(self.backward, -self.x, self.x) * self.weight
        return weighted - np.multiply.outer(weighted @ own / (own @ own), own)


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


def curve_points(variable: str, at: ArrayLike, value: ArrayLike, std: ArrayLike) -> CurvePoints:
    """Points of a curve at (M,), given by (S, M) torques and errors; what is not finite is left out."""
    rows, errors = np.asarray(value, float), np.asarray(std, float)
    x = np.tile(np.asarray(at, float), (len(rows), 1))
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
            values, explained = family.fit(points, DIRECTIONS[direction], shifted)
            worth = explained - PRICE * (len(values) - 1 + shifted)
            if worth > most:
                best, most = CurveForm(kind, direction, variable, unit, values, explained), worth
    return best if best is not None and best.explained >= MIN_EXPLAINED else None


@dataclass(frozen=True)
class FormFamily:
    """Curves of one kind, with I nonlinear parameters."""

    # x (N,) and nonlinear parameters (I, G, 1) → rows (K, G, N), whose sizes are free
    basis: Callable[[Array, Array], Array]
    # lowest and highest x → values to try of each nonlinear parameter
    grid: Callable[[float, float], tuple[Array, ...]]
    # nonlinear parameters (I, G), lowest and highest x → the nearest ones that make sense
    possible: Callable[[Array, float, float], Array]
    # sizes (K,) and nonlinear parameters (I,) → the parameters by name
    named: Callable[[Array, Array], dict[str, float]]

    def fit(
        self, points: CurvePoints, factors: tuple[float, float], shifted: bool
    ) -> tuple[dict[str, float], float]:
        """Parameters and explained share of the best curve of the family.

        With `shifted`, plus a constant, in each direction of its sign, that other effects may have taken:
        Coulomb friction in the model leaves a curve of position known up to a step.
        """
        low, high = float(points.x.min()), float(points.x.max())
        factor = np.where(points.backward, factors[1], factors[0]) * points.weight
        constant = np.where(points.backward, -1.0, 1.0) * points.weight
        wanted = points.counted(points.torque * points.weight)
        grid = np.array(list(product(*self.grid(low, high)))).T

        def rows(inner: Array) -> Array:  # (G, K, N)
            own = self.basis(points.x, inner[..., None]) * factor
            both = (own, np.broadcast_to(constant, (1, *own.shape[1:])))[: 1 + shifted]
            return points.counted(np.concatenate(both).swapaxes(0, 1))

        def left(inner: Array) -> Array:  # (G, N)
            return _without(wanted, rows(inner))

        def possible(inner: Array) -> Array:
            return self.possible(inner, low, high)

        costs = np.sum(left(grid) ** 2, axis=1)
        first = np.argsort(costs, kind="stable")[:REFINED]
        ends, costs = grid[:, first], costs[first]
        if len(grid):
            ends, costs = _refined(left, possible, ends, 1e-6 * np.ptp(grid, axis=1))
        best = int(np.argmin(costs))
        end = ends[:, best]
        sizes = np.linalg.lstsq(rows(end[:, None])[0].T, wanted, rcond=RANK**0.5)[0]
        explained = 1 - float(costs[best] / np.sum(wanted**2))
        return self.named(sizes[: len(sizes) - shifted], end), explained


def _without(wanted: Array, rows: Array) -> Array:
    """What rows (G, K, N) cannot explain of (N,), shape (G, N), by Gram–Schmidt orthogonalisation."""
    rest = np.broadcast_to(wanted, (len(rows), len(wanted)))
    own: list[Array] = []
    for row in rows.swapaxes(0, 1):
        least = RANK * np.sum(row**2, axis=1, keepdims=True)
        for other in own:
            row = row - np.sum(row * other, axis=1, keepdims=True) * other
        square = np.sum(row**2, axis=1, keepdims=True)
        own.append(np.where(square > least, row / np.sqrt(np.maximum(square, 1e-300)), 0.0))
        rest = rest - np.sum(rest * own[-1], axis=1, keepdims=True) * own[-1]
    return rest


def _refined(
    left: Callable[[Array], Array], possible: Callable[[Array], Array], inner: Array, small: Array
) -> tuple[Array, Array]:
    """Minima from starts (I, G), and their weighted squares (G,); `small` (I,) for differences."""
    size, count = inner.shape
    moves = np.concatenate((np.zeros((size, 1)), np.diag(small)), axis=1)
    before = np.full(count, np.inf)
    for _ in range(STEPS):
        around = left((inner[:, None] + moves[..., None]).reshape(size, -1)).reshape(1 + size, count, -1)
        slopes = (around[1:] - around[0]) / small[:, None, None]
        normal = np.einsum("ign,jgn->gij", slopes, slopes)
        normal += 1e-9 * np.einsum("gii->gi", normal)[:, None] * np.eye(size) + 1e-300 * np.eye(size)
        step = -np.linalg.solve(normal, np.einsum("ign,gn->gi", slopes, around[0])[..., None])[..., 0]
        trials = possible((inner[..., None] + step.T[..., None] * LENGTHS).reshape(size, -1))
        squares = np.sum(left(trials) ** 2, axis=1).reshape(count, -1)
        best = np.argmin(squares, axis=1) + len(LENGTHS) * np.arange(count)
        inner, after = trials[:, best], squares.ravel()[best]
        if not np.any(after < (1 - SETTLED) * before):
            break
        before = after
    return inner, after


def _wave(sizes: Array, inner: Array) -> dict[str, float]:
    size, phase = float(np.hypot(*sizes)), float(np.arctan2(sizes[1], sizes[0]))
    return {"size": size, "order": float(inner[0]), "phase": phase}


def _always(inner: Array, low: float, high: float) -> Array:
    return inner


def _within(inner: Array, low: float, high: float) -> Array:
    least, most = LEAST_WIDTH * (high - low), MOST_WIDTH * (high - low)
    return np.stack((np.clip(inner[0], low, high), np.clip(inner[1], least, most)))


def _decaying(inner: Array, low: float, high: float) -> Array:
    least, most = LEAST_DECAY / (high - low), MOST_DECAY / (high - low)
    return np.copysign(np.clip(np.abs(inner), least, most), inner)


FAMILIES: Mapping[str, FormFamily] = {
    "constant": FormFamily(
        lambda x, inner: np.ones((1, 1, len(x))),
        lambda low, high: (),
        _always,
        lambda s, i: {"size": float(s[0])},
    ),
    "line": FormFamily(
        lambda x, inner: np.stack((x, np.ones(len(x))))[:, None],
        lambda low, high: (),
        _always,
        lambda s, i: {"size": float(s[1]), "slope": float(s[0])},
    ),
    "bump": FormFamily(
        lambda x, inner: np.exp(-(((x - inner[0]) / inner[1]) ** 2))[None],
        lambda low, high: (np.linspace(low, high, 25), (high - low) * np.array([0.04, 0.08, 0.16, 0.32])),
        _within,
        lambda s, i: {"size": float(s[0]), "centre": float(i[0]), "width": float(i[1])},
    ),
    "exponential": FormFamily(
        lambda x, inner: np.exp(np.minimum(inner[0] * x, 300.0))[None],  # a load may be far from zero
        lambda low, high: (np.array([-16.0, -8, -4, -2, -1.2, 1.2, 2, 4, 8, 16]) / (high - low),),
        _decaying,
        lambda s, i: {"size": float(s[0]), "rate": float(i[0])},
    ),
    "sine": FormFamily(
        lambda x, inner: np.stack((np.sin(inner[0] * x), np.cos(inner[0] * x))),
        lambda low, high: (2 * np.pi / max(high - low, 1e-9) * np.arange(LEAST_TURNS, 13.0, 0.25),),
        lambda inner, low, high: np.maximum(inner, 2 * np.pi * LEAST_TURNS * 0.95 / (high - low)),
        _wave,
    ),
}
