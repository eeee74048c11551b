"""What a design minimises, as a function of the information gathered (see `information`)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexviz.analysis.estimation import Projection, sandwich
from flexviz.base.arrays import Array, Indices
from flexviz.base.errors import InputError, choose_from
from flexviz.base.facts import Fact

DEFAULT_PARAMETERS = ("stiffness", "motor_inertia", "link_viscous_friction", "motor_viscous_friction")
SMALLEST_SCALE = 0.05  # of the largest value with the same name: a parameter near zero has no relative error
SPECIAL_CASE = 1e-3  # share of an effect's own gain that another one with more parameters leaves of it


class DesignCriterion(ABC):
    """A function of the total information; smaller is better.

    Attributes:
        fact: what it is.
        unit: of `shown`.
    """

    fact: Fact
    unit: str

    @abstractmethod
    def value(self, gram: Array) -> float:
        """To be minimised, logarithmic, of the information (Q, Q) without the prior."""

    @abstractmethod
    def shown(self, value: float) -> float:
        """A value as it is shown."""


@dataclass(frozen=True, eq=False)
class LeastErrors(DesignCriterion):
    """Relative standard errors of some parameters: their root mean square, or their geometric mean.

    The geometric mean is that of the axes of the joint confidence ellipsoid.
    """

    prior: Array  # (P, P)
    chosen: Indices  # indices of the parameters
    scale: Array  # (C,), what their standard errors are relative to
    geometric: bool = False  # log-det instead of trace
    unit = "%"

    @property
    def fact(self) -> Fact:  # type: ignore[override]
        return Fact("design-criterion", values={"of": "volume" if self.geometric else "errors"})

    def value(self, gram: Array) -> float:
        covariance = sandwich(gram, gram, self.prior).matrix[np.ix_(self.chosen, self.chosen)]
        relative = covariance / np.outer(self.scale, self.scale)
        if self.geometric:
            return 0.5 * float(np.linalg.slogdet(relative)[1]) / len(self.chosen)
        return 0.5 * float(np.log(np.trace(relative) / len(self.chosen)))

    def shown(self, value: float) -> float:
        return 100 * float(np.exp(value))


@dataclass(frozen=True, eq=False)
class BestSeparation(DesignCriterion):
    """Expected gain by which the true one of two effects beats the other one, refitted with everything.

    The gain is half the non-centrality: the squared norm that is left of the effect's contribution to the
    residual when the rest of the model and the other effect are projected out. The smaller of the two gains
    (either effect may be the true one) is maximised. An effect that is a special case of the other one, as an
    offset is of a spring with a rest angle, cannot win by fitting better: there only the other gain counts.
    """

    prior: Array  # (P, P)
    own: tuple[Indices, Indices]  # indices of each effect's parameters
    counts: tuple[bool, bool] = (True, True)  # which of the two gains counts
    fact = Fact("design-criterion", values={"of": "separation"})
    unit = ""

    def gains(self, gram: Array) -> tuple[float, float]:
        """Of the first effect over the second, and of the second over the first."""
        root = _root(gram)
        return self._left(root, gram, 0, self.own[0]), self._left(root, gram, 1, self.own[1])

    def _left(self, root: Array, gram: Array, k: int, without: Indices) -> float:
        """Half the norm that is left of contribution k by the model without some parameters."""
        count = len(self.prior)
        kept = np.setdiff1d(np.arange(count), without)
        hessian = (gram[:count, :count] + self.prior)[np.ix_(kept, kept)]
        projection = Projection(np.zeros(len(root)), root[:, kept], hessian, np.zeros(len(kept)))
        return 0.5 * float(projection.normal(root[:, [count + k]])[0][0, 0])

    def value(self, gram: Array) -> float:
        gains = [gain for gain, counts in zip(self.gains(gram), self.counts, strict=True) if counts]
        return -float(np.log(max(min(gains), 1e-9)))

    def without_special_case(self, gram: Array) -> BestSeparation:
        """The same, without the gain of an effect that is a special case of the other by this information."""
        root, both = _root(gram), np.concatenate(self.own)
        special = [
            len(own) < len(other) and gain < SPECIAL_CASE * self._left(root, gram, k, both)
            for k, (own, other, gain) in enumerate(
                zip(self.own, self.own[::-1], self.gains(gram), strict=True)
            )
        ]
        return replace(self, counts=(not special[0], not special[1]))

    def shown(self, value: float) -> float:
        return float(np.exp(-value))


def _root(gram: Array) -> Array:
    """R (Q, Q) with Rᵀ R = gram."""
    values, vectors = np.linalg.eigh(gram)
    return np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T


def least_errors(
    labels: Sequence[str], x: Array, prior: Array, wanted: Sequence[str], geometric: bool
) -> LeastErrors:
    """Criterion for the `wanted` parameters, by `name` (everywhere) or `name:place`, or `DEFAULT_PARAMETERS`.

    `labels` and `x` (P,) are those of all parameters, `prior` is (P, P).
    """
    chosen: dict[int, None] = {}
    names = [label.partition(":")[0] for label in labels]
    for text in wanted or DEFAULT_PARAMETERS:
        found = [k for k, label in enumerate(labels) if text in (label, names[k])]
        if not found:
            valid = choose_from(text, dict.fromkeys((*names, *labels)), 40)
            raise InputError(f'parameter "{text}" is not in the model; {valid}')
        chosen.update(dict.fromkeys(found))
    index = np.array(list(chosen))
    largest = {n: max(abs(v) for m, v in zip(names, x, strict=True) if m == n) for n in set(names)}
    scale = [max(abs(x[k]), SMALLEST_SCALE * largest[names[k]]) for k in index]
    return LeastErrors(prior, index, np.where(np.array(scale) > 0, scale, 1.0), geometric)
