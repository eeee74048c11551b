"""The law of an effect through its data: binned partial residuals, and the law on the same bins.

A partial residual is what the model with the effect leaves, plus the effect's own contribution. What is
left is projected onto bins of the effect's variable in the place where the effect acts: a torque or a
deflection a_b in bin b reaches the residual through the elastic joint and the filters as a column C_b, so
that

    r + C a = noise,    a = −(CᵀC + Λ)⁻¹ Cᵀ r,    data_b = law_b + a_b

with everything weighted by the spectrum of the sensors' noise. A step stays a step, although a filter has
rounded it in the residual.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from flexviz.analysis.estimation import LONGEST_EDGE, WIDE_HERTZ, noise_density, noise_paths
from flexviz.analysis.laws.bins import Means, binned, path_length, tukey
from flexviz.analysis.laws.variables import LawSamples, LawVariable, variable_of
from flexviz.base.arrays import Array, Indices
from flexviz.base.errors import InputError
from flexviz.base.fields import Floats
from flexviz.base.fourier import fast_length
from flexviz.base.units import joint_unit
from flexviz.data.measurements import MeasurementSet
from flexviz.data.noise import segments_noise
from flexviz.model.effects import EFFECTS, ChosenEffect, LawEffect, neighbour
from flexviz.model.equation import Chain, Equation, Layout, Signals, build_signals, layout_of
from flexviz.model.observers import ButterworthZeroPhase
from flexviz.robot.model import FlexibleModel

BINS = (32, 16, 8)
FINE = (400, 200, 100)  # bins in which the law is drawn
ROUGH, SLIGHT = 1.25, 0.02  # path of the drawn law: times that over coarse bins, and of the law's size
PRIOR = 0.3  # of the joint's torque or deflection: how far a bin may lie from the law
CLEAR = 0.05  # of the law's size: noise of a bin above which there are fewer bins
ROBUST_STEPS, HUBER, MEDIAN = 5, 2.0, 0.6745  # MEDIAN: of |x| relative to the standard deviation
SAMPLE_STEP = 1 / (8 * WIDE_HERTZ)  # [s] of the residual
MODEL_ERROR = 5e-4  # of a joint's torque spread at 50 samples a second, added to the noise
ERROR_STEP = 0.02  # [s] of those samples
HIGHEST_HERTZ = 8.0  # of the residual: above, products of filtered signals err more than the sensors
TOGETHER = 0.25  # [s] over which what the model leaves is correlated
TAPER = 0.4  # [s] at both ends of a stretch, where filters and whitening have not settled
FEWEST = 3  # instants of the fine grid in a bin
SHOWN = 0.25  # of the law's size: a bin with more noise shows nothing and is left out


@dataclass(frozen=True, eq=False)
class LawThroughData:
    """One law and its binned partial residuals; arrays have shape (B,), bins that show nothing left out.

    Attributes:
        effect, joint, group, payload: the effect, and the joint on which it is drawn.
        variable, unit: the horizontal axis, by the name of a `LawVariable`.
        quantity, quantity_unit: the vertical axis.
        at: mean of the variable in each bin.
        law, law_std: mean of the law in each bin, and its standard error from the parameters' covariance.
        data, data_std: partial residual in each bin, and its standard error from what the model leaves.
        noise: the part of that standard error that stems from the sensors' noise.
        count: instants of the fine grid in each bin.
        leftover: rms of what bins and model leave, relative to the sensors' noise.
        fine_at, fine_law, fine_std: the law and its standard error on a fine grid of the variable, shape
            (F,); empty in results of earlier versions.
    """

    effect: str
    joint: str
    group: str | None
    payload: str | None
    variable: str
    unit: str
    quantity: str
    quantity_unit: str
    at: Floats
    law: Floats
    law_std: Floats
    data: Floats
    data_std: Floats
    noise: Floats
    count: Floats
    leftover: float
    fine_at: Floats = field(default_factory=lambda: np.zeros(0))
    fine_law: Floats = field(default_factory=lambda: np.zeros(0))
    fine_std: Floats = field(default_factory=lambda: np.zeros(0))

    @property
    def line(self) -> tuple[Array, Array, Array]:
        """The variable, the law and its standard error as they are drawn."""
        return (
            (self.fine_at, self.fine_law, self.fine_std)
            if len(self.fine_at)
            else (self.at, self.law, self.law_std)
        )

    @property
    def chi_square(self) -> float:
        """Mean square of data − law relative to noise and the law's own error; 1 for the right law."""
        squares = (self.data - self.law) ** 2 / (self.noise**2 + self.law_std**2)
        return float(np.mean(squares)) if len(squares) else 1.0


def laws_of(
    measurements: MeasurementSet,
    model: FlexibleModel,
    effects: Sequence[str],
    covariance: Array | None = None,
    only: str | None = None,
) -> tuple[LawThroughData, ...]:
    """The laws of an identified model with the set's effects and additional `effects`.

    `covariance` (P, P) of its parameters gives each law its interval; `only` is the text of the only one to
    draw. Joints that follow goals have no torque through which a law could be drawn.
    """
    if measurements.drive is not None:
        return ()
    layout = layout_of(measurements, effects)
    covariance = np.zeros((layout.size, layout.size)) if covariance is None else covariance
    chosen = [e for e in layout.effects if only in (None, e.text(layout.joints))]
    found = laws_through_data(measurements, layout, layout.vector(model), covariance, chosen)
    return tuple(found.values())


def laws_through_data(
    measurements: MeasurementSet,
    layout: Layout,
    x: Array,
    covariance: Array,
    only: Collection[ChosenEffect] | None = None,
) -> dict[ChosenEffect, LawThroughData]:
    """The laws of all effects of a model through the data of all groups.

    Args:
        layout, x, covariance: the model, its parameters (P,) and their covariance (P, P).
        only: the effects to draw; None: all.

    Returns:
        effect → its law; empty where the records are too short.
    """
    wanted = [pair for pair in layout.effect_slices() if only is None or pair[0] in only]
    try:
        drawn = _Drawing(measurements, layout, x) if wanted else None
    except InputError:  # records that are too short for the band
        drawn = None
    if drawn is None:
        return {}
    return {effect: drawn.law(effect, covariance[where, where]) for effect, where in wanted}


class _Drawing:
    """Residual of a model at x (P,) in a wide band, and how noise reaches it."""

    def __init__(self, measurements: MeasurementSet, layout: Layout, x: Array) -> None:
        observer = ButterworthZeroPhase(2 * np.pi * WIDE_HERTZ)
        signals = build_signals(
            measurements, measurements.groups, observer,
            sample_step=SAMPLE_STEP, exact_step=True, longest_edge=LONGEST_EDGE,
        )  # fmt: skip
        self._signals: Signals = replace(signals, sharp=True)
        self._layout, self._x = layout, x
        self._point = Equation(measurements.robot, self._signals, layout).at(x)
        link = self._point.link_terms(x)
        self._chain = Chain(x[layout.compliance], x[layout.link_viscous], link)
        paths = noise_paths(layout, x, link)
        sensors = segments_noise([b.segment for b in signals.blocks])
        spread = np.array(measurements.torque_spread)
        self._size = PRIOR * np.stack((spread, spread * x[layout.compliance]))  # (2, n) [Nm], [rad]
        error = 2 * ERROR_STEP * (MODEL_ERROR * spread) ** 2  # [Nm²/Hz]
        self._weights, self._lines = [], 0.0
        for block in signals.blocks:
            rows, step = block.rows, block.segment.step
            length = fast_length(2 * (rows.stop - rows.start))
            hertz: Array = np.arange(length // 2 + 1) / (length * step * block.stride)
            here = [path.rows(rows) for path in paths]
            density = noise_density(here, sensors, observer.transfer, step, hertz)
            inside = (hertz < HIGHEST_HERTZ)[:, None]
            weight = inside / np.sqrt((density + error) / (2 * step * block.stride))
            count = rows.stop - rows.start
            self._weights.append((length, weight, tukey(count, TAPER / (step * block.stride))))
            self._lines += count * float(inside.mean()) * layout.n
        self._residual = self._whitened(self._point.residual(x)[..., None])[..., 0]

    def _whitened(self, values: Array) -> Array:
        """Residuals or columns (N, n, C) divided by the root of the noise's spectrum."""
        out = np.empty_like(values)
        for block, (length, weight, taper) in zip(self._signals.blocks, self._weights, strict=True):
            tapered = values[block.rows] * taper[:, None, None]
            spectrum = np.fft.rfft(tapered, length, axis=0) * weight[..., None]
            out[block.rows] = np.fft.irfft(spectrum, length, axis=0)[: block.rows.stop - block.rows.start]
        return out

    def law(self, effect: ChosenEffect, covariance: Array) -> LawThroughData:
        """The law of one effect; covariance (P, P) of its parameters. As many bins as the data support."""
        joint, u, slopes = self._law(effect, self._x[self._layout.effect_slice(effect)])
        stretches = self._stretches(effect, joint, u)
        found = self._binned(effect, joint, stretches, slopes, covariance, BINS[0])
        for bins in BINS[1:]:
            if np.median(found.noise) <= CLEAR * (np.ptp(found.law) + np.abs(found.law).max(initial=0.0)):
                break
            found = self._binned(effect, joint, stretches, slopes, covariance, bins)
        return found

    def _binned(
        self, effect: ChosenEffect, joint: int, stretches: list[LawSamples], slopes: list[Array],
        covariance: Array, bins: int,
    ) -> LawThroughData:  # fmt: skip
        kind = EFFECTS[effect.effect]
        variable, name = variable_of(kind), self._layout.joints[joint]
        at = [variable.of(one) for one in stretches]
        per = [variable.per(one) * self._acts(effect, k) for k, one in enumerate(stretches)]
        index = binned(at, per, bins)
        means = Means(at, per, [one.u for one in stretches], slopes, covariance)
        coarse = means.of(index, bins, FEWEST)
        law, size = coarse.law, max(float(np.ptp(coarse.law) + np.abs(coarse.law).max(initial=0.0)), 1e-12)
        fine, most = coarse, ROUGH * path_length(law) + SLIGHT * size
        for count in FINE:  # a law that depends on more than the variable scatters in fine bins
            finer = means.of(binned(at, per, count), count, 1)
            if path_length(finer.law) <= most:
                fine = finer
                break
        mean_square = np.mean(np.concatenate(per) ** 2)
        prior = max(size, self._size[int(kind.entry == "deflection"), joint] / np.sqrt(mean_square))
        left, noise, std, leftover = self._left(kind.entry, joint, index, per, coarse.bins, prior)
        kept = noise <= max(SHOWN * size, float(noise.min(initial=np.inf)))
        sign, quantity, unit = _vertical(variable, kind.entry == "deflection")
        across, unit = (joint_unit(one, joint in self._layout.sliding) for one in (variable.unit, unit))
        return LawThroughData(
            effect.effect, name, effect.group, effect.payload, variable.name, across,
            quantity, unit, coarse.at[kept], sign * law[kept], coarse.std[kept], sign * (law + left)[kept],
            std[kept], noise[kept], coarse.count[kept], leftover, fine.at, sign * fine.law, fine.std,
        )  # fmt: skip

    def _left(
        self, entry: str, joint: int, index: list[Indices], per: list[Array], used: Indices, prior: float
    ) -> tuple[Array, Array, Array, float]:
        """a (B,) in the bins `used`, its standard errors from noise and residual, and the leftover.

        Instants at which the law jumps within the noise of its signals err most: large residuals count less.
        """
        parts = [np.where(bins == used[:, None], by, 0.0) for bins, by in zip(index, per, strict=True)]
        depth = 1 if entry in ("residual", "gravity") else 3
        filtered = self._point.context.filtered(parts, joint, depth)[..., None]
        columns = self._whitened(self._chain.columns(entry, (joint,), filtered)).reshape(-1, len(used))
        left, weight = self._residual.ravel(), np.ones(self._residual.size)
        scale = np.sqrt(self._lines / self._residual.size)
        for _ in range(ROBUST_STEPS):
            inverse = np.linalg.inv((columns.T * weight) @ columns + np.eye(len(used)) / prior**2)
            found = -inverse @ (columns.T @ (weight * left))
            rest = left + columns @ found
            leftover = float(np.median(np.abs(rest))) / (MEDIAN * scale)
            weight = np.minimum(1.0, HUBER * scale * max(leftover, 1.0) / np.maximum(np.abs(rest), 1e-12))
        score = (columns * (weight * rest)[:, None]).reshape(self._signals.count, -1, len(used)).sum(axis=1)
        score = np.add.reduceat(score, np.arange(0, len(score), round(TOGETHER / SAMPLE_STEP)))
        noise, seen = np.diag(inverse), np.sum((score @ inverse) ** 2, axis=0)
        return found, np.sqrt(noise), np.sqrt(np.maximum(noise, seen)), leftover

    def _acts(self, effect: ChosenEffect, block: int) -> float:
        """Whether an effect acts in a stretch: an episode in one group, a payload where it is carried."""
        group = self._signals.groups[self._signals.blocks[block].group]
        return float(effect.group in (None, group.name) and effect.payload in (None, group.payload))

    def _law(self, effect: ChosenEffect, values: Array) -> tuple[int, list[Array], list[Array]]:
        """Joint on which the law is largest, u (N_fine,) and ∂u/∂p (P, N_fine) in every stretch."""
        kind, context = EFFECTS[effect.effect], self._point.context
        if isinstance(kind, LawEffect):
            joint = effect.place.own_joint
            both = [kind.law(motion, values) for motion in context.motions(joint)]
            return joint, [u for u, _ in both], [slope for _, slope in both]
        terms = kind.terms(context, effect.place, values)
        column = int(np.argmax(np.mean(terms.value[0] ** 2, axis=0)))
        joint = terms.joints[column]
        both = np.vstack((terms.value[:1, :, column], terms.slopes[:, 0, :, column]))
        table = self._on_fine_grid(joint, both)
        return joint, [rows[0] for rows in table], [rows[1:] for rows in table]

    def _on_fine_grid(self, joint: int, rows: Array) -> list[Array]:
        """Rows (R, N) at the samples on the fine grid of every stretch, (R, N_fine) each."""
        blocks, motions = self._signals.blocks, self._point.context.motions(joint)
        return [
            np.array([np.interp(m.time, self._signals.time[b.rows], row[b.rows]) for row in rows])
            for m, b in zip(motions, blocks, strict=True)
        ]

    def _stretches(self, effect: ChosenEffect, joint: int, u: list[Array]) -> list[LawSamples]:
        context, other = self._point.context, neighbour(joint, self._layout.n)
        values = self._x[self._layout.effect_slice(effect)]
        named = np.zeros(self._signals.count)
        if effect.payload is not None:
            named = context.payload_torque(effect.payload)[:, joint]
        payload = self._on_fine_grid(joint, named[None])
        return [
            LawSamples(
                motion, fine.tau[0, :, joint], fine.tau[1, :, joint], fine.velocity[:, other],
                fine.theta[2, :, other], payload[k][0], u[k], values,
            )
            for k, (motion, fine) in enumerate(zip(context.motions(joint), context.fine(), strict=True))
        ]  # fmt: skip


def _vertical(variable: LawVariable, deflection: bool) -> tuple[float, str, str]:
    """Sign, name and unit of the vertical axis: the deflection beyond that of the spring K is −u."""
    if deflection:
        return -1.0, "deflection beyond s/K", "rad"
    per = f"/({variable.per_unit})" if "/" in variable.per_unit else f"/{variable.per_unit}"
    return 1.0, variable.quantity or "opposing torque", f"Nm{per if variable.per_unit else ''}"
