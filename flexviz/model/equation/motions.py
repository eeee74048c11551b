"""Wide-band motions of the joints, as effects see them.

Few laws follow the transmission torque or the link side, and these cost most: they are computed when a law
first asks for them, and what depends on the parameters alone is kept for every torque of the equation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np

from flexviz.base.arrays import Array
from flexviz.model.effects import EFFECTS, JointMotion, LawEffect
from flexviz.model.equation.fine_signals import FineSignals
from flexviz.model.equation.layout import Layout
from flexviz.model.equation.signals import Block, Signals
from flexviz.model.equation.splines import uniform_spline
from flexviz.model.observers import ButterworthZeroPhase

Level = tuple[Array, Array]  # transmission torque and its rate in one stretch, shape (N_fine,) each

LEAST_VISCOUS_SHARE = 0.2  # minimum share of a joint's viscous friction on the motor side
LEAST_VISCOUS = 1e-6  # [Nm s/rad] absolute minimum
OVERLAP = 0.2  # [s] at both ends of the equation's samples, over which the wide-band torque is aligned
LATE = frozenset({"torque", "link_position", "link_velocity", "torque_scale"})


class MotionOnDemand(JointMotion):
    """A motion whose torque and link side are computed when a law first asks for them."""

    @staticmethod
    def of(known: Mapping[str, Any], late: Callable[[], Mapping[str, Any]]) -> MotionOnDemand:
        """A motion with the attributes `known`; `late` gives those in `LATE`."""
        motion = object.__new__(MotionOnDemand)
        motion.__dict__.update(known, notes={}, _late=late)
        return motion

    def __getattr__(self, name: str) -> Any:
        if name not in LATE:
            raise AttributeError(name)
        self.__dict__.update(self.__dict__["_late"]())
        return self.__dict__[name]


class WideMotions:
    """The motions at parameters x (P,).

    Args:
        fine: wide-band signals of every stretch.
    """

    def __init__(self, signals: Signals, layout: Layout, x: Array, fine: list[FineSignals]) -> None:
        self.fine = fine
        self._signals, self._layout, self._x = signals, layout, x
        self._wide: dict[int, list[Level]] = {}
        self._smooth: dict[int, list[Level]] = {}
        self._in_band: dict[int, list[Array | None]] = {}

    def of(self, joint: int, s: Array | None) -> list[JointMotion]:
        """Motions of a joint in every stretch.

        `s`: (N, n), transmission torque of the equation, without friction [Nm]; None: the wide-band one, with
        all of it.
        """
        lay, x = self._layout, self._x
        stiffness, viscous = 1 / x[lay.compliance][joint], viscous_scale(lay, x, joint)[0]
        present = {
            effect.effect: tuple(x[where].tolist())
            for effect, where in lay.effect_slices()
            if effect.joint == joint
        }
        transmission = cache(lambda: self._transmission(joint, s))
        motions = []
        for index, (fine, block) in enumerate(zip(self.fine, self._signals.blocks, strict=True)):
            degrees = self._signals.groups[block.group].temperature
            known = dict(
                time=fine.time,
                position=fine.position[:, joint],
                velocity=fine.velocity[:, joint],
                stiffness=stiffness,
                motor_viscous=viscous,
                temperature=np.nan if degrees is None else float(degrees[joint]),
                present=present,
            )
            motions.append(MotionOnDemand.of(known, lambda k=index: transmission()[k]))
        return motions

    def _transmission(self, joint: int, s: Array | None) -> list[dict[str, Any]]:
        """Torque and link side in every stretch; the scale is the rms torque over all of them."""
        levels = self._wide_levels(joint) if s is None else self._levels(joint, s)
        scale = float(np.sqrt(np.mean(np.concatenate([torque for torque, _ in levels]) ** 2))) + 1e-12
        compliance = self._x[self._layout.compliance][joint]
        return [
            dict(
                torque=torque,
                link_position=fine.position[:, joint] - compliance * torque,
                link_velocity=fine.velocity[:, joint] - compliance * rate,
                torque_scale=scale,
            )
            for fine, (torque, rate) in zip(self.fine, levels, strict=True)
        ]

    # -- the transmission torque

    def _wide_levels(self, joint: int) -> list[Level]:
        """The wide-band torque."""
        if joint not in self._wide:
            lay, x = self._layout, self._x
            inertia, viscous = (values[joint] for values in lay.motor_side(x))
            self._wide[joint] = levels = []
            for fine in self.fine:
                theta, tau = fine.theta[:, :, joint], fine.tau[:, :, joint]
                torque = tau[0] - inertia * theta[2] - viscous * theta[1]
                levels.append((torque, tau[1] - inertia * theta[3] - viscous * theta[2]))
        return self._wide[joint]

    def _levels(self, joint: int, s: Array) -> list[Level]:
        """The transmission torque s of the equation, continued by the wide-band torque without friction.

        Outside the time span of the equation's samples in the stretch, the wide-band torque is used, also
        without friction: a damped joint would respond to a step of friction that is subtracted on one side
        only. If the signals are sharp, it is used throughout, corrected by what s differs by in its own band:
        without what is above that band, reversals of the link are milliseconds off.
        """
        if joint not in self._smooth:
            self._smooth[joint] = self._without_friction(joint)
            parts = zip(self._signals.blocks, self.fine, self._smooth[joint], strict=True)
            self._in_band[joint] = [self._of_samples(joint, *part) for part in parts]
        out, wide = [], zip(self._smooth[joint], self._in_band[joint], strict=True)
        for fine, block, (smooth, in_band) in zip(self.fine, self._signals.blocks, wide, strict=True):
            torque, rate = (level.copy() for level in smooth)
            inside, near = self._inside(fine, block)
            known = s[block.rows, joint] - (0.0 if in_band is None else in_band)
            time = self._signals.time[block.rows]
            step = (time[-1] - time[0]) / (len(time) - 1)
            change, slope = uniform_spline(known, (fine.time[inside] - time[0]) / step)
            slope /= step
            if in_band is None:
                change -= torque[inside]
                rate[inside] = 0.0
            torque[inside] += change
            rate[inside] += slope
            torque[: inside.start] += np.median(change[:near])
            torque[inside.stop :] += np.median(change[-near:])
            out.append((torque, rate))
        return out

    def _of_samples(self, joint: int, block: Block, fine: FineSignals, level: Level) -> Array | None:
        """The part of a wide-band torque in the band of the equation, at its samples, shape (N_block,).

        None unless the signals are sharp. What the torque of the equation differs by is smooth: near the edge
        of its band, where a period has less than three samples, the torque itself cannot be interpolated.
        """
        if not self._signals.sharp:
            return None
        slow = self._signals.observer_of(joint).derivatives(level[0][:, None], fine.step, 1)[0, :, 0]
        time = self._signals.time[block.rows]
        return slow[np.round((time - fine.time[0]) / fine.step).astype(int)]

    def _without_friction(self, joint: int) -> list[Level]:
        """The wide-band torque without friction; unless the signals are sharp, at both ends only.

        Only laws of the joint's own motion are subtracted: with a torque gain, a delay or coupling as well as
        damping, the residual still errs at both ends of a stretch.
        """
        laws = [(EFFECTS[e.effect], at) for e, at in self._layout.effect_slices() if e.joint == joint]
        own = [(law, at) for law, at in laws if isinstance(law, LawEffect) and law.entry == "torque"]
        if not own:
            return self._wide_levels(joint)
        out = []
        parts = zip(self.fine, self._signals.blocks, self.of(joint, None), strict=True)
        for (fine, block, motion), wide in zip(parts, self._wide_levels(joint), strict=True):
            torque, rate = (level.copy() for level in wide)
            inside, near = self._inside(fine, block)
            friction = np.sum([law.law(motion, self._x[at])[0] for law, at in own], axis=0)
            band = ButterworthZeroPhase(2 * np.pi * float(fine.torque_hertz[joint]))
            reach = round(band.memory() / motion.step)
            needed = [(slice(None), slice(None))]
            if not self._signals.sharp:
                needed = _ends(inside.start + near, inside.stop - near, len(torque), reach)
            for used, taken in needed:
                slow = band.derivatives(friction[taken, None], motion.step, 2)[:, used, 0]
                torque[taken][used] -= slow[0]
                rate[taken][used] -= slow[1]
            out.append((torque, rate))
        return out

    def _inside(self, fine: FineSignals, block: Block) -> tuple[slice, int]:
        """Fine samples within the equation's, and how many at each end align the wide-band torque."""
        time = self._signals.time[block.rows]
        first = int(np.searchsorted(fine.time, time[0]))
        last = int(np.searchsorted(fine.time, time[-1], side="right"))
        return slice(first, last), max(1, round(OVERLAP / fine.step))


def _ends(head: int, tail: int, count: int, reach: int) -> list[tuple[slice, slice]]:
    """Samples before `head` and from `tail` on, each within a stretch that is longer by `reach`.

    Returns:
        where the samples are in the stretch, and the stretch; all samples in one if the two would overlap.
    """
    if head + reach >= tail - reach:
        return [(slice(0, count), slice(0, count))]
    start = tail - reach
    return [(slice(0, head), slice(0, head + reach)), (slice(reach, count - start), slice(start, count))]


def viscous_scale(layout: Layout, x: Array, joint: int) -> tuple[float, float, float]:
    """Motor-side viscous friction that scales effects, bounded from below; derivatives by f_mv and f_lv."""
    motor, link = float(layout.motor_side(x)[1][joint]), float(x[layout.link_viscous][joint])
    share = LEAST_VISCOUS_SHARE
    if motor >= max(share * (motor + link), LEAST_VISCOUS):
        return motor, 1.0, 0.0
    if share * (motor + link) >= LEAST_VISCOUS:
        return share * (motor + link), share, share
    return LEAST_VISCOUS, 0.0, 0.0
