"""What the equation offers to effects: wide-band motion on a fine grid, filters, observer outputs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from flexviz._pinocchio import pin
from flexviz.effects import EFFECTS, JointMotion, LawEffect
from flexviz.equation.layout import Layout
from flexviz.equation.signals import Block, Signals
from flexviz.noise import segments_noise
from flexviz.observers import ButterworthZeroPhase
from flexviz.robot import Robot

Array = NDArray[np.float64]

FINE_STEP = 2e-3  # [s] the effects' laws are evaluated at least this often
# the velocity whose sign friction follows: wide enough for sharp reversals, narrow enough for little noise
SIGN_BANDWIDTH_HZ = 70.0  # at an encoder noise of 2e-5 rad per sample at 1 ms
SIGN_REFERENCE_NOISE = 2e-5 * np.sqrt(1e-3)  # [rad √s]
TORQUE_NOISE = 5e-3  # the transmission torque's noise may be this share of its rms
LINK_VELOCITY_NOISE = 4e-3  # [rad/s]
LEAST_SHARE, LEAST_VISCOUS = 0.2, 1e-6  # of a joint's viscous friction, [Nm s/rad]: that on the motor side
OVERLAP = 0.2  # [s] at either end of what the equation knows of a torque; a reversal in it does no harm
BAND_STEP = 1.05  # bands within this factor are the same to signals that models share


@dataclass(frozen=True)
class _Fine:
    """Wide-band signals of one stretch, shape (N_fine, n) each."""

    time: Array
    step: float
    position: Array
    velocity: Array
    theta: Array  # (4, N_fine, n) in the torque's band: what s and ṡ need
    tau: Array  # (2, N_fine, n)
    torque_hertz: Array  # (n,), that band


class EffectContext:
    """Offers signals to effects; `refresh` renews what depends on the parameters."""

    def __init__(
        self, robot: Robot, signals: Signals, layout: Layout, shared: dict[object, Any] | None = None
    ) -> None:
        """`shared` holds what only the signals determine: one for all models of the same signals."""
        self._robot, self._signals, self._layout = robot, signals, layout
        self._shared: dict[object, Any] = {} if shared is None else shared
        self._fine: list[_Fine] | None = None
        self._x: Array | None = None
        self._q: Array | None = None
        self._s: Array | None = None
        self._motions: dict[int, list[JointMotion]] = {}
        self._tau: Array | None = None
        self._cache: dict[object, Array] = {}

    def refresh(self, x: Array, q: Array, s: Array | None = None) -> None:
        """Take over the parameters x, shape (P,), and what the equation found with them.

        q, shape (3, N, n), is the link side; s, shape (N, n), the transmission torque, friction taken off.
        """
        self._x, self._q, self._s = x.copy(), q, s
        self._motions.clear()
        self._cache = {}

    @property
    def last_s(self) -> Array | None:
        """The link's torque of the last refresh."""
        return self._s

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
                raw = block.segment.tau[:, joint : joint + 1]
                shift = self._signals.torque_hold / 2 + delay
                values = observer.derivatives(raw, block.segment.step, 4, delay=shift, stride=block.stride)
                out[:, block.rows] = values[:, self._signals.kept(block), 0]
            cache[key] = out
        return cache[key]

    def link_state(self, joint: int) -> Array:
        assert self._q is not None
        return self._q[:, :, joint]

    def in_group(self, group: str) -> NDArray[np.bool_]:
        out = np.zeros(self.count(), bool)
        for block in self._signals.blocks:
            out[block.rows] = self._signals.groups[block.group].name == group
        return out

    def payload_torque(self, payload: str) -> Array:
        key = ("payload", payload)
        if key not in self._cache:
            out = np.zeros((self.count(), self.joints()))
            assert self._q is not None
            for block in self._signals.blocks:
                if self._signals.groups[block.group].payload == payload:
                    model = self._model_with(self._signals.payload[block.group])
                    out[block.rows] = self._inverse_dynamics(model, self._q[:, block.rows])
            self._cache[key] = out
        return self._cache[key]

    def gravity_torque(self, axis: int) -> Array:
        key = ("gravity", axis)
        if key not in self._cache:
            assert self._q is not None and self._x is not None
            out = np.empty((self.count(), self.joints()))
            inertial = self._x[self._layout.inertial].reshape(-1, 10)
            still = np.zeros(self.joints())
            for block in self._signals.blocks:
                model = self._model_with(inertial + self._signals.payload[block.group])
                model.gravity.linear = np.eye(3)[axis]
                data = model.createData()
                q = np.ascontiguousarray(self._robot.to_pin(self._q[0, block.rows]))
                for k, row in enumerate(q):
                    out[block.rows.start + k] = pin.rnea(model, data, row, still, still)
            self._cache[key] = self._robot.from_pin(out)
        return self._cache[key]

    def once(self, key: tuple[object, ...], make: Callable[[], Array]) -> Array:
        observer = self._signals.observer
        full = (*key, observer.name, float(np.max(observer.bandwidth)), self.count())
        if full not in self._shared:
            self._shared[full] = make()
        return self._shared[full]

    def filtered(self, parts: Sequence[Array], joint: int, depth: int) -> Array:
        observer = self._signals.observer_of(joint)
        out = np.empty((len(parts[0]), depth, self.count()))
        for block, part, fine in zip(self._signals.blocks, parts, self.fine(), strict=True):
            stride = block.stride // self._fine_stride(block)
            values = observer.derivatives(part.T, fine.step, depth, stride=stride)
            out[:, :, block.rows] = values[:, self._signals.kept(block)].transpose(2, 0, 1)
        return out

    def filtered_block(self, index: int, part: Array, joint: int, depth: int) -> Array:
        """Columns (C, N_fine) of one stretch through the joint's observer: shape (C, depth, N_block)."""
        block, fine = self._signals.blocks[index], self.fine()[index]
        stride = block.stride // self._fine_stride(block)
        values = self._signals.observer_of(joint).derivatives(part.T, fine.step, depth, stride=stride)
        return values[:, self._signals.kept(block)].transpose(2, 0, 1)

    def pulses_block(self, index: int, at: NDArray[np.intp], joint: int, depth: int) -> Array:
        """Unit samples at fine instants `at` (M,) of one stretch, filtered: shape (M, depth, N_block).

        A pulse's way through the filter is the same wherever it is, so it is looked up, not filtered.
        """
        kernel, reach = self._impulse(joint, self.fine()[index].step)
        lag = np.clip(self._sampled(index)[None, :] - at[:, None], -reach - 1, reach + 1)
        return kernel[:depth, lag + reach + 1].transpose(1, 0, 2)

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

    def _sampled(self, index: int) -> NDArray[np.intp]:
        """Fine instants of a stretch's samples."""
        fine = self.fine()[index]
        time = self._signals.time[self._signals.blocks[index].rows]
        return np.round((time - fine.time[0]) / fine.step).astype(int)

    def _impulse(self, joint: int, step: float) -> tuple[Array, int]:
        """Three derivatives of the filter's impulse response on the fine grid, and its reach."""
        observer = self._signals.observer_of(joint)
        key = ("impulse", observer.name, float(np.max(observer.bandwidth)), round(step, 9))
        if key not in self._shared:
            reach = int(np.ceil(max(observer.settling()) / step))
            unit = np.zeros((4 * reach + 1, 1))
            unit[2 * reach] = 1.0
            kernel = observer.derivatives(unit, step, 3)[:, reach : 3 * reach + 1, 0]
            self._shared[key] = np.pad(kernel, ((0, 0), (1, 1))), reach
        return self._shared[key]

    def motions(self, joint: int) -> Sequence[JointMotion]:
        if joint not in self._motions:
            self._motions[joint] = self._make_motions(joint)
        return self._motions[joint]

    # -- fine signals ------------------------------------------------------------------------------------

    def _make_motions(self, joint: int) -> list[JointMotion]:
        lay, x = self._layout, self._x
        assert x is not None
        compliance, inertia = x[lay.compliance][joint], x[lay.motor_inertia][joint]
        viscous = x[lay.motor_viscous][joint]
        present = {
            effect.effect: tuple(x[where].tolist())
            for effect, where in lay.effect_slices()
            if effect.joint == joint
        }
        motions, rates = [], []
        for fine in self.fine():
            theta, tau = fine.theta[:, :, joint], fine.tau[:, :, joint]
            torque = tau[0] - inertia * theta[2] - viscous * theta[1]
            rate = tau[1] - inertia * theta[3] - viscous * theta[2]
            position, velocity = fine.position[:, joint], fine.velocity[:, joint]
            motions.append(
                JointMotion(
                    fine.time,
                    position,
                    velocity,
                    torque,
                    position - compliance * torque,
                    velocity - compliance * rate,
                    1 / compliance,
                    viscous_scale(lay, x, joint)[0],
                    1.0,
                    present,
                )
            )
            rates.append(rate)
        motions = _scaled(motions)
        if self._s is None:
            return motions
        bands = [float(fine.torque_hertz[joint]) for fine in self.fine()]
        parts = zip(motions, rates, self._signals.blocks, bands, strict=True)
        return _scaled([self._without_friction(joint, *part) for part in parts])

    def _without_friction(
        self, joint: int, motion: JointMotion, rate: Array, block: Block, hertz: float
    ) -> JointMotion:
        """The same with what the equation itself found of the torque, friction taken off.

        It is known between the equation's first and last sample of the stretch. What is beyond has to go on
        from there, as the two differ nearby: a step of friction that is taken off on one side only is one
        that a damped joint answers to.
        """
        assert self._s is not None and self._x is not None
        torque, rate = motion.torque.copy(), rate.copy()
        laws = [(EFFECTS[e.effect], at) for e, at in self._layout.effect_slices() if e.joint == joint]
        own = [(law, at) for law, at in laws if isinstance(law, LawEffect) and law.entry == "torque"]
        if own:
            friction = np.sum([law.law(motion, self._x[at])[0] for law, at in own], axis=0)
            slow = ButterworthZeroPhase(2 * np.pi * hertz).derivatives(friction[:, None], motion.step, 2)
            torque -= slow[0, :, 0]
            rate -= slow[1, :, 0]
        time = self._signals.time[block.rows]
        known = CubicSpline(time, self._s[block.rows, joint])
        inside = (motion.time >= time[0]) & (motion.time <= time[-1])
        first, last = np.flatnonzero(inside)[[0, -1]]
        found, near = known(motion.time[inside]), max(1, round(OVERLAP / motion.step))
        torque[:first] += np.median((found - torque[inside])[:near])
        torque[last + 1 :] += np.median((found - torque[inside])[-near:])
        torque[inside], rate[inside] = found, known(motion.time[inside], 1)
        compliance = self._x[self._layout.compliance][joint]
        return replace(
            motion,
            torque=torque,
            link_position=motion.position - compliance * torque,
            link_velocity=motion.velocity - compliance * rate,
        )

    def _fine_stride(self, block: Block) -> int:
        wanted = max(1, int(FINE_STEP / block.segment.step + 1e-6))
        return max(d for d in range(1, min(wanted, block.stride) + 1) if block.stride % d == 0)

    def fine(self) -> list[_Fine]:
        """Wide-band signals of every block, made once for all models whose bands are nearly the same."""
        if self._fine is None:
            assert self._x is not None
            lay, sig = self._layout, self._signals
            if "noise" not in self._shared:
                self._shared["noise"] = segments_noise([b.segment for b in sig.blocks])
            noise = self._shared["noise"]
            inertia, stiffness = self._x[lay.motor_inertia], 1 / self._x[lay.compliance]
            scale = np.sqrt(np.mean(sig.tau[0] ** 2, axis=0)) + 1e-9
            wide = [self._sign_band(b, noise[0]) for b in sig.blocks]
            narrow = [
                torque_band(
                    noise[0] * root, noise[1] * root, inertia, stiffness, scale, self._band_limit(block)
                )
                for block in sig.blocks
                for root in [np.sqrt(block.segment.step)]
            ]
            strides = tuple(self._fine_stride(b) for b in sig.blocks)
            key = (
                "fine",
                strides,
                *(tuple(np.round(np.log(w) / np.log(BAND_STEP))) for w in (*wide, *narrow)),
            )
            if key not in self._shared:
                self._shared[key] = [
                    self._make_fine(block, a, b) for block, a, b in zip(sig.blocks, wide, narrow, strict=True)
                ]
            made: list[_Fine] = self._shared[key]
            self._fine = made
        return self._fine

    def _band_limit(self, block: Block) -> float:
        return 0.3 / (block.segment.step * self._fine_stride(block))

    def _sign_band(self, block: Block, noise_theta: Array) -> Array:
        """Band of the velocity whose sign friction follows, shape (n,) [Hz]."""
        density = noise_theta * np.sqrt(block.segment.step)
        band = SIGN_BANDWIDTH_HZ * (SIGN_REFERENCE_NOISE / (density + 1e-12)) ** (2 / 3)
        return np.clip(band, 4.0, self._band_limit(block))

    def _make_fine(self, block: Block, wide_hertz: Array, narrow_hertz: Array) -> _Fine:
        segment, stride = block.segment, self._fine_stride(block)
        wide = ButterworthZeroPhase(2 * np.pi * wide_hertz)
        position = wide.derivatives(segment.theta, segment.step, 2, position=True, stride=stride)
        narrow = ButterworthZeroPhase(2 * np.pi * narrow_hertz)
        theta = narrow.derivatives(segment.theta, segment.step, 4, position=True, stride=stride)
        delay = self._signals.torque_hold / 2
        tau = narrow.derivatives(segment.tau, segment.step, 2, delay=delay, stride=stride)
        time, step = segment.time[::stride], segment.step * stride
        return _Fine(time, step, position[0], position[1], theta, tau, narrow_hertz)

    # -- rigid body ------------------------------------------------------------------------------------------

    def _model_with(self, parameters: Array):
        model = self._robot.model.copy()
        for i, row in enumerate(parameters):
            inertia = pin.Inertia.FromDynamicParameters(row) if row[0] > 0 else pin.Inertia.Zero()
            model.inertias[1 + int(self._robot.order[i])] = inertia
        return model

    def _inverse_dynamics(self, model, q: Array) -> Array:
        data = model.createData()
        rows = [np.ascontiguousarray(self._robot.to_pin(level)) for level in q]
        out = np.array([pin.rnea(model, data, a, b, c) for a, b, c in zip(*rows, strict=True)])
        return self._robot.from_pin(out)


def _scaled(motions: list[JointMotion]) -> list[JointMotion]:
    """The same with the torque's rms over all stretches."""
    scale = float(np.sqrt(np.mean(np.concatenate([m.torque for m in motions]) ** 2))) + 1e-12
    return [replace(motion, torque_scale=scale) for motion in motions]


def torque_band(
    theta: Array, tau: Array, inertia: Array, stiffness: Array, scale: Array, limit: float
) -> Array:
    """Widest band in which s and the link velocity are quiet enough, shape (n,) [Hz].

    Args:
        theta, tau: shape (n,), noise densities [rad √s], [Nm √s].
        inertia, stiffness, scale: shape (n,): B, K and the rms torque.
        limit: no wider than this [Hz].
    """
    f = np.geomspace(2.0, max(limit, 2.01), 60)[:, None]
    w = 2 * np.pi * f
    # one-sided densities 2d²; s = τ − Bθ̈ and ṡ/K = (τ̇ − Bθ⃛)/K, integrated up to f
    torque = np.sqrt(2 * f * (tau**2 + inertia**2 * theta**2 * w**4 / 5))
    rate = np.sqrt(2 * f * (tau**2 * w**2 / 3 + inertia**2 * theta**2 * w**6 / 7)) / stiffness
    quiet = (torque < TORQUE_NOISE * scale) & (rate < LINK_VELOCITY_NOISE)
    widest = np.where(quiet, f, 0.0).max(axis=0)
    return np.clip(widest, 2.0, limit)


def viscous_scale(layout: Layout, x: Array, joint: int) -> tuple[float, float, float]:
    """The f_mv that effects are relative to, also where the split is not right yet; ∂ by f_mv and by f_lv."""
    motor, link = float(x[layout.motor_viscous][joint]), float(x[layout.link_viscous][joint])
    if motor >= max(LEAST_SHARE * (motor + link), LEAST_VISCOUS):
        return motor, 1.0, 0.0
    if LEAST_SHARE * (motor + link) >= LEAST_VISCOUS:
        return LEAST_SHARE * (motor + link), LEAST_SHARE, LEAST_SHARE
    return LEAST_VISCOUS, 0.0, 0.0
