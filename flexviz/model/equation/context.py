"""Signals offered to effects: wide-band motion on a fine grid, filters, observer outputs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import Any

import numpy as np

from flexviz.base.arrays import Array, Bools, Indices
from flexviz.base.recent import Recent
from flexviz.model.effects import JointMotion
from flexviz.model.equation.fine_signals import FineBands, FineSignals, fine_bands, fine_signals, fine_stride
from flexviz.model.equation.layout import Layout
from flexviz.model.equation.link import LinkDynamics
from flexviz.model.equation.motions import WideMotions
from flexviz.model.equation.signals import Signals
from flexviz.model.observers import ButterworthZeroPhase, largest_divisor

KEPT_COLUMNS = 100  # joints whose columns that depend on no parameters are kept
KEPT_BYTES = 1e8  # of long records fewer


class EffectContext:
    """Signals for effects at given parameters; implements `flexviz.model.effects.Context`.

    Args:
        link: rigid-body dynamics.
        signals: signals of the equation.
        layout: layout of x.
        shared: cache of quantities that depend on the signals only, common to all their models.
        x: shape (P,), parameters offered to the effects.
        q: shape (3, N, n), link side offered to the effects [rad/s^k].
        s: shape (N, n), transmission torque without friction [Nm]; None before it is known.
        bands: of the wide-band signals of an earlier context.
    """

    def __init__(
        self,
        link: LinkDynamics,
        signals: Signals,
        layout: Layout,
        shared: dict[object, Any],
        x: Array,
        q: Array,
        s: Array | None = None,
        bands: FineBands | None = None,
    ) -> None:
        self._link, self._signals, self._layout = link, signals, layout
        self._shared = shared
        self._x, self._q, self.s = x.copy(), q, s
        self._bands = bands
        self._motions: dict[int, list[JointMotion]] = {}
        self._at: WideMotions | None = None
        self._used: list[FineSignals] | None = None  # what determines the motions, where s does not
        self._of: EffectContext | None = None  # whose motions effects see
        self._cache: dict[object, Array] = {}

    def forget(self) -> None:
        """Discard what can be computed again."""
        self._motions, self._cache, self._at, self._used = {}, {}, None, None

    def seeing(self, x: Array, q: Array, s: Array | None) -> EffectContext:
        """The same signals with other parameters."""
        other = EffectContext(self._link, self._signals, self._layout, self._shared, x, q, s, self._bands)
        other._of = self._of
        if np.array_equal(x, self._x):
            other._at = self._at
        return other

    def at_samples_of(self, signals: Signals, shared: dict[object, Any], q: Array) -> EffectContext:
        """The same motions for effects at the samples of other signals; q there, shape (3, N, n)."""
        bands = self._fine_bands()
        other = EffectContext(self._link, signals, self._layout, shared, self._x, q, None, bands)
        other._of = self
        return other

    def take_motions(self, earlier: EffectContext) -> None:
        """Use the motions of an earlier context with the same parameters, where they are the same."""
        if earlier._motions and self.s is None and self.fine() is earlier._used:
            self._motions, self._used = earlier._motions, earlier._used

    # -- the protocol ------------------------------------------------------------------------------------

    def count(self) -> int:
        return self._signals.count

    def joints(self) -> int:
        return self._layout.n

    def theta(self, joint: int) -> Array:
        return self._signals.theta[:, :, joint]

    def tau(self, joint: int) -> Array:
        return self.delayed_tau(joint, 0.0)

    def delayed_tau(self, joint: int, delay: float) -> Array:
        observer = self._signals.observer_of(joint)
        band = float(np.max(observer.bandwidth))
        key = ("torque", observer.name, band, self.count(), joint, round(delay, 12))
        cache = self._shared if delay == 0.0 else self._cache
        if key not in cache:
            out = np.empty((4, self.count()))
            for block in self._signals.blocks:
                raw = block.torque[:, joint : joint + 1]
                shift = self._signals.torque_hold / 2 + delay
                values = observer.derivatives(raw, block.segment.step, 4, delay=shift, stride=block.stride)
                out[:, block.rows] = values[:, self._signals.kept(block), 0]
            cache[key] = out
        return cache[key]

    def of_torque(self, joint: int, law: Callable[[Array], Array]) -> Array:
        parts, observer = [], self._signals.observer_of(joint)
        for block in self._signals.blocks:
            raw, delay = law(block.segment.tau[:, joint]).T, self._signals.torque_hold / 2
            values = observer.derivatives(raw, block.segment.step, 3, delay=delay, stride=block.stride)
            parts.append(values[:, self._signals.kept(block)].transpose(2, 0, 1))
        return np.concatenate(parts, axis=2)

    def link_state(self, joint: int) -> Array:
        return self._q[:, :, joint]

    def in_group(self, group: str) -> Bools:
        out = np.zeros(self.count(), bool)
        for block in self._signals.blocks:
            out[block.rows] = self._signals.groups[block.group].name == group
        return out

    def payload_torque(self, payload: str) -> Array:
        key = ("payload", payload)
        if key not in self._cache:
            out = np.zeros((self.count(), self.joints()))
            for block in self._signals.blocks:
                if self._signals.groups[block.group].payload == payload:
                    known = self._signals.payload[block.group]
                    out[block.rows] = self._link.torque(known, *self._q[:, block.rows])
            self._cache[key] = out
        return self._cache[key]

    def gravity(self) -> Array:
        return self._link.gravity

    def gravity_torque(self, axis: int) -> Array:
        key = ("gravity", axis)
        if key not in self._cache:
            out = np.empty((self.count(), self.joints()))
            inertial = self._x[self._layout.inertial].reshape(-1, 10)
            for block in self._signals.blocks:
                bodies = inertial + self._signals.payload[block.group]
                out[block.rows] = self._link.gravity_torque(bodies, self._q[0, block.rows], axis)
            self._cache[key] = out
        return self._cache[key]

    def once(self, key: tuple[object, ...], make: Callable[[], Array]) -> Array:
        observer = self._signals.observer
        full = (*key, observer.name, float(np.max(observer.bandwidth)), self.count())
        if full not in self._shared:
            size = attrgetter("nbytes")
            self._shared[full] = Recent[Array]("columns", KEPT_COLUMNS, size, KEPT_BYTES)
        return self._shared[full].get(make)

    def filtered(
        self, parts: Sequence[Array], joint: int, depth: int, every: Sequence[int] | None = None
    ) -> Array:
        out = np.empty((len(parts[0]), depth, self.count()))
        for index, (block, part) in enumerate(zip(self._signals.blocks, parts, strict=True)):
            out[:, :, block.rows] = self.filtered_block(
                index, part, joint, depth, every[index] if every else 1
            )
        return out

    def decimation(self, joint: int, depth: int, highest: float) -> list[int]:
        band, out = self._signals.observer_of(joint).cutoff(depth - 1), []
        for block, fine in zip(self._signals.blocks, self.fine(), strict=True):
            # no content may be folded into the band of the observer
            most = 1.0 if band is None else 2 * np.pi / (fine.step * (band + highest))
            out.append(largest_divisor(block.stride // fine_stride(block), most))
        return out

    def filtered_block(self, index: int, part: Array, joint: int, depth: int, every: int = 1) -> Array:
        """Columns of one stretch through the joint's observer: shape (C, depth, N_block).

        Args:
            part: shape (C, ceil(N_fine / every)).
        """
        block, fine = self._signals.blocks[index], self.fine()[index]
        stride = block.stride // (fine_stride(block) * every)
        values = self._signals.observer_of(joint).derivatives(part.T, fine.step * every, depth, stride=stride)
        return values[:, self._signals.kept(block)].transpose(2, 0, 1)

    def pulses_block(
        self,
        index: int,
        at: Indices,
        joint: int,
        depth: int,
        rows: slice = slice(None),
        lag: float = 0.0,
    ) -> Array:
        """Filtered unit samples at fine instants `at` (M,) of one stretch, shape (M, depth, N_rows).

        Looked up in the filter's impulse response; `rows`: samples of the stretch, default: all; `lag`: of
        what bends a joint with this time constant D/K [s].
        """
        kernel, reach = self._impulse(joint, self.fine()[index].step, lag)
        since = np.clip(self._sampled(index)[None, rows] - at[:, None], -reach - 1, reach + 1)
        return kernel[:depth, since + reach + 1].transpose(1, 0, 2)

    def pulse_rows(self, index: int, at: Indices, joint: int, inside: slice) -> slice:
        """Samples of a stretch where pulses at fine instants `at` (M,) are not zero, two at least.

        `inside`: samples of the stretch that are looked at.
        """
        sampled = self._sampled(index)[inside]
        reach = self._impulse(joint, self.fine()[index].step)[1]
        first = int(np.searchsorted(sampled, at.min() - reach))
        last = int(np.searchsorted(sampled, at.max() + reach, side="right"))
        first = max(min(first, len(sampled) - 2), 0)
        return slice(inside.start + first, inside.start + max(last, first + 2))

    def steps_block(self, index: int, instants: Array, joint: int) -> Array:
        """Unit steps at `instants` (M,) [s] of one stretch, filtered: shape (M, N_block)."""
        fine = self.fine()[index]
        kernel, reach = self._impulse(joint, fine.step)
        rise = np.cumsum(kernel[0])
        place = (np.asarray(instants) - fine.time[0]) / fine.step
        first = np.ceil(place - 0.5).astype(int)
        share = (first - place + 0.5)[:, None]  # of the first sample
        lag = self._sampled(index)[None, :] - first[:, None]
        lag = np.clip(lag, -reach, reach + 1)
        return share * kernel[0, lag + reach + 1] + rise[lag + reach]

    def _sampled(self, index: int) -> Indices:
        """Fine instants of a stretch's samples."""
        fine = self.fine()[index]
        time = self._signals.time[self._signals.blocks[index].rows]
        return np.round((time - fine.time[0]) / fine.step).astype(int)

    def _impulse(self, joint: int, step: float, lag: float = 0.0) -> tuple[Array, int]:
        """Three derivatives of the filter's impulse response on the fine grid, and its half-length.

        `lag`: of the torque that bends a joint with this time constant [s].
        """
        observer = self._signals.observer_of(joint)
        key = ("impulse", observer.name, float(np.max(observer.bandwidth)), round(step, 9))
        if lag:  # to one per cent, so that many fits share them
            lag, seen = (np.exp(round(np.log(max(v, 1e-9)), 2)) for v in (lag, self.seen()[joint]))
            key = (*key, lag, seen)
        if key not in self._shared:
            reach = int(np.ceil(max(observer.settling()) / step))
            unit = np.zeros((4 * reach + 1, 1))
            unit[2 * reach] = 1.0
            if lag:
                late = unit - low_passed(unit, lag, step)  # an effect sees it as `WideMotions` makes it
                own = ButterworthZeroPhase(seen).derivatives(late, step, 1)[0] if seen > 1e-3 else 0.0 * late
                unit = unit - own - observer.derivatives(late - own, step, 1)[0]
            kernel = observer.derivatives(unit, step, 3)[:, reach : 3 * reach + 1, 0]
            self._shared[key] = np.pad(kernel, ((0, 0), (1, 1))), reach
        return self._shared[key]

    # -- motions -----------------------------------------------------------------------------------------

    def fine(self) -> list[FineSignals]:
        """Wide-band signals of every block."""
        if self._of is not None:
            return self._of.fine()
        return fine_signals(self._signals, self._fine_bands(), self._shared)

    def seen(self) -> Array:
        """Band in which effects see the transmission torque, after the observer's, shape (n,) [rad/s]."""
        if not self._signals.sharp:
            return np.zeros(self._layout.n)
        return 2 * np.pi * np.min(self._fine_bands().narrow, axis=0)

    def _fine_bands(self) -> FineBands:
        if self._bands is None:
            inertia, stiffness = self._layout.motor_side(self._x)[0], 1 / self._x[self._layout.compliance]
            self._bands = fine_bands(self._signals, inertia, stiffness, self._shared)
        return self._bands

    def motions(self, joint: int) -> Sequence[JointMotion]:
        if self._of is not None:
            return self._of.motions(joint)
        if joint not in self._motions:
            fine = self.fine()
            self._used = None if self.s is not None else fine
            if self._at is None or self._at.fine is not fine:
                self._at = WideMotions(self._signals, self._layout, self._x, fine)
            self._motions[joint] = self._at.of(joint, self.s)
        return self._motions[joint]


def low_passed(values: Array, lag: float, step: float) -> Array:
    """Samples (N, …) that end with zeros, through 1/(1 + lag d/dt); `step` between samples [s]."""
    omega = 2 * np.pi * np.fft.rfftfreq(len(values), step)
    return np.fft.irfft(np.fft.rfft(values.T) / (1 + 1j * omega * lag), len(values)).T
