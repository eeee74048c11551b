"""The closed loop: sampled controller and integrated plant."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from flexviz.base.errors import Cancelled, ConvergenceError
from flexviz.base.progress import Progress, ProgressCallback, StopCallback, ignore, never
from flexviz.model.simulation import rates
from flexviz.model.simulation.building import TorquePath
from flexviz.model.simulation.control import TorqueFilter
from flexviz.model.simulation.integrator import stepper
from flexviz.model.simulation.plant import Array, Plant
from flexviz.model.simulation.sensors import Feedback

Compensate = Callable[[int, Array], Array]  # cycle, commanded torque (n,) → torque added to it (n,) [Nm]
PROGRESS_CYCLES = 1024  # between calls of progress and should_stop
LARGEST_TORQUE = 1e12  # [Nm] beyond which the simulation counts as diverged


@dataclass(frozen=True, eq=False)
class Loop:
    """A plant under τ = target(t) − k_p θ − k_d θ̇, held for a cycle (n joints, Pinocchio's order)."""

    plant: Plant
    torque_path: TorquePath
    target: Array  # (cycles, n) k_p θ_d + k_d θ̇_d + feedforward [Nm]
    kp: Array
    kd: Array
    cycle: float  # [s]
    smooth: TorqueFilter | None = None  # filter of the applied and recorded torque, or None
    feedback: Feedback | None = None  # measured motion for the controller; None: the true motion
    compensate: Compensate | None = None  # torque at the drive in addition to the commanded and recorded one
    step: float | None = None  # largest integration step [s]; None: from the fastest motion

    def drive(
        self,
        x: Array,
        before: Array,
        cycles: int | None = None,
        progress: ProgressCallback = ignore,
        should_stop: StopCallback = never,
    ) -> tuple[Array, Array]:
        """States (cycles, 4n + …) at the start of every cycle, and the torques (cycles, n) of the cycles.

        `x` is the initial state, `before` (n,) the torque before t = 0 [Nm].
        """
        n, cycle, kp, kd = self.plant.n, self.cycle, self.kp, self.kd
        cycles = len(self.target) if cycles is None else min(cycles, len(self.target))
        x = x.copy()
        theta, speed = x[n : 2 * n], x[3 * n : 4 * n]
        target, smooth, feedback = self.target, self.smooth, self.feedback
        states, torques = np.empty((cycles, len(x))), np.empty((cycles, n))
        sent = np.empty_like(torques)
        advance = stepper(self.plant, x)
        fine = self._substeps(x)
        gain, limit = 1.0 + self.torque_path.gain_error, self.torque_path.limit
        limited = bool(np.isfinite(limit).any())
        straight = not self.torque_path.delay.any() and not self.torque_path.gain_error.any()
        parts = self._parts(fine)
        columns = np.arange(n)
        for k in range(cycles):
            states[k] = x
            if feedback is None:
                tau = target[k] - kp * theta - kd * speed
            else:
                seen, seen_speed = feedback(k, theta)
                tau = target[k] - kp * seen - kd * seen_speed
            if smooth is not None:
                tau = smooth(tau)
            torques[k] = tau
            if self.compensate is not None:
                tau = tau + self.compensate(k, tau)
            sent[k] = tau = np.clip(tau, -limit, limit) if limited else tau
            now = k * cycle
            if straight:
                advance(tau, now, cycle, fine)
            else:
                for offset, length, count, back in parts:
                    source = k - back
                    applied = np.where(source >= 0, sent[np.maximum(source, 0), columns], before)
                    advance(applied * gain, now + offset, length, count)
            if k % PROGRESS_CYCLES == 0:
                _check(tau, now)
                if should_stop():
                    raise Cancelled("the simulation was stopped")
                progress(Progress("simulating", k / cycles))
        if not np.isfinite(states[-1]).all():
            raise ConvergenceError("the simulation diverged")
        progress(Progress("simulating", 1.0))
        return states, torques

    def _substeps(self, x: Array) -> int:
        if self.step is not None:
            return max(1, round(self.cycle / self.step))
        n = self.plant.n
        # positions the controller aims at: where the gains are zero, the start stands for all
        aim = self.target[:: max(1, len(self.target) // 12)] / np.where(self.kp > 0, self.kp, np.inf)
        aim = np.where(self.kp > 0, aim, x[:n])
        return rates.substeps(self.plant, np.clip(aim, -2 * np.pi, 2 * np.pi), self.cycle)

    def _parts(self, fine: int) -> list[tuple[float, float, int, Array]]:
        """A cycle cut where a joint's delayed torque changes: offset, length, substeps, cycles back (n,)."""
        whole = np.floor(self.torque_path.delay / self.cycle + 1e-9)
        rest = self.torque_path.delay - whole * self.cycle
        rest = np.where(rest < 1e-6 * self.cycle, 0.0, rest)
        cuts = [0.0, *sorted(set(rest[rest > 0].tolist())), self.cycle]
        parts = []
        for start, end in pairwise(cuts):
            back = (whole + (rest > start)).astype(int)
            count = max(1, int(np.ceil(fine * (end - start) / self.cycle - 1e-9)))
            parts.append((start, end - start, count, back))
        return parts


def _check(tau: Array, now: float) -> None:
    if not np.isfinite(tau).all() or np.abs(tau).max() > LARGEST_TORQUE:
        raise ConvergenceError(f"the simulation diverged at {now:.3f} s")
