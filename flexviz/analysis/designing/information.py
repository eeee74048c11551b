"""Information of a group: Gram matrix of the identification equation's whitened Jacobian.

The residual's noise is stationary within a group, its spectral density S known in closed form. With the
transform Ĵ of the Jacobian's columns at N samples of step h, the information of the group is

    G = Σ_f 2h/N · Ĵ(f)ᴴ S(f)⁻¹ Ĵ(f)      (f of either sign)

which is Jᵀ J / σ² for white noise. G adds up over groups. Correlations between joints are neglected here;
`prediction` takes them into account for the finished design.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexviz.analysis.estimation import noise_density, noise_paths, start_values
from flexviz.base.arrays import Array
from flexviz.base.errors import InputError
from flexviz.base.fourier import line_counts
from flexviz.data.measurements import Group, MeasurementSet
from flexviz.model.effects import EFFECTS, ChosenEffect
from flexviz.model.equation import Chain, Equation, Layout, LinkTerms, build_signals, layout_of
from flexviz.model.observers import FlatZeroPhase
from flexviz.robot.model import FlexibleModel

BAND = 6.0  # [Hz] of the Jacobian, as in `--refine`
SAMPLE_STEP = 1 / (3.6 * BAND)  # [s]
EDGE = 0.4  # [s] dropped at both ends, as in `--refine`


def information(columns: Array, density: Array, step: float) -> Array:
    """Gram matrix (Q, Q) of columns (N, n, Q), contiguous in time, sampled with `step` [s].

    `density`: (N // 2 + 1, n), one-sided, of the residual's noise at the frequencies of the transform.
    """
    count = len(columns)
    spectrum = np.fft.rfft(columns, axis=0)
    weight = np.sqrt(2 * step / count * line_counts(count)[:, None] / density)
    flat = (spectrum * weight[:, :, None]).reshape(-1, columns.shape[2])
    return flat.real.T @ flat.real + flat.imag.T @ flat.imag


@dataclass(frozen=True)
class Contender:
    """One of two effects to tell apart."""

    text: str  # of the effect, "backlash:joint2"
    own: tuple[str, ...]  # labels of its parameters


class Columns:
    """Columns of one model, or of two that differ in an effect.

    Of two: the parameters that they share, those of the first effect alone, those of the second alone, and
    the contribution of each effect to the residual.

    Attributes:
        labels: of the parameters, shape (P,).
        x: shape (P,), values in the solver's units.
        contenders: the two effects; empty for one model.
    """

    def __init__(
        self,
        measurements: MeasurementSet,
        models: Sequence[FlexibleModel],
        noise: tuple[Array, Array],
        step: float,
    ) -> None:
        self._noise, self._step = noise, step
        self._layouts = [_layout(measurements, model) for model in models]
        self._vectors = [lay.vector(model) for lay, model in zip(self._layouts, models, strict=True)]
        labels = [lay.labels() for lay in self._layouts]
        first, last = labels[0], labels[-1]
        shared = [one for one in first if one in last]
        self.labels = tuple(dict.fromkeys((*shared, *first, *last)))
        self.contenders: tuple[Contender, ...] = ()
        if len(models) == 2:
            self._added = [_only_in(lay, other) for lay, other in (self._layouts, self._layouts[::-1])]
            self.contenders = tuple(
                Contender(one.text(lay.joints), tuple(x for x in own if x not in shared))
                for one, lay, own in zip(self._added, self._layouts, labels, strict=True)
            )
        values = dict(zip(last, self._vectors[-1], strict=True)) | dict(
            zip(first, self._vectors[0], strict=True)
        )
        self.x = np.array([values[label] for label in self.labels])

    @property
    def layout(self) -> Layout:
        """The first model's."""
        return self._layouts[0]

    @property
    def size(self) -> int:
        """Number of columns Q."""
        return len(self.labels) + len(self.contenders)

    def prior(self, measurements: MeasurementSet) -> Array:
        """Hessian of the prior (P, P), as identification would have it with these groups."""
        out = np.zeros((len(self.labels), len(self.labels)))
        signals = build_signals(measurements, measurements.fit_groups, FlatZeroPhase(2 * np.pi * BAND))
        for layout, x in reversed(list(zip(self._layouts, self._vectors, strict=True))):
            start = start_values(measurements, Equation(measurements.robot, signals, layout))
            place = [self.labels.index(label) for label in layout.labels()]
            out[np.ix_(place, place)] = start.prior.gradient_and_hessian(x)[1]
        return out

    def gram(self, measurements: MeasurementSet, groups: Sequence[Group]) -> Array:
        """Information (Q, Q) of groups."""
        observer = FlatZeroPhase(2 * np.pi * BAND)
        signals = build_signals(
            measurements, groups, observer, sample_step=SAMPLE_STEP, exact_step=True, drop=(EDGE, EDGE),
            longest_edge=0.1,
        )  # fmt: skip
        columns = np.zeros((signals.count, len(measurements.joints), self.size))
        link: LinkTerms | None = None
        for k, (layout, x) in enumerate(zip(self._layouts, self._vectors, strict=True)):
            point = Equation(measurements.robot, signals, layout).at(x)
            found = point.evaluate(x, moving=True)
            link = link or found.link
            # what both models have is taken from the first one
            mine = [(i, self.labels.index(label)) for i, label in enumerate(layout.labels())]
            fresh = [(i, at) for i, at in mine if k == 0 or self.labels[at] in self.contenders[1].own]
            columns[:, :, [at for _, at in fresh]] = found.jacobian[:, :, [i for i, _ in fresh]]
            if self.contenders:
                chain = Chain(x[layout.compliance], x[layout.link_viscous], found.link)
                term = dict(zip(layout.effects, (t for _, t in point.terms(x)), strict=True))[self._added[k]]
                added = chain.column(term.entry, term.joints, term.value)
                columns[:, :, len(self.labels) + k] = added
        assert link is not None
        total = np.zeros((self.size, self.size))
        for block in signals.blocks:
            rows, step = block.rows, block.segment.step * block.stride
            hertz = np.asarray(np.fft.rfftfreq(rows.stop - rows.start, step), float)
            density = noise_density(
                noise_paths(self.layout, self._vectors[0], link.rows(rows)),
                self._noise,
                _derivative,
                self._step,
                hertz,
            )
            total += information(columns[rows], density, step)
        return total


def _layout(measurements: MeasurementSet, model: FlexibleModel) -> Layout:
    for effect in model.effects:
        if EFFECTS[effect.effect].scope == "episode":
            raise InputError(f'effect "{effect.text}" is an episode, which no motion can be designed for')
    return layout_of(measurements, [effect.text for effect in model.effects])


def _only_in(layout: Layout, other: Layout) -> ChosenEffect:
    """The effect that one of two models lacks."""
    for effect in layout.effects:
        if effect not in other.effects:
            return effect
    names = ", ".join(effect.text(layout.joints) for effect in layout.effects) or "none"
    raise InputError(
        f"two effects to tell apart: both models have the same ones ({names}), expected one each"
    )


def _derivative(omega: Array, order: int) -> Array:
    """Gain to a derivative, without a filter."""
    return (1j * omega) ** order  # type: ignore[return-value]
