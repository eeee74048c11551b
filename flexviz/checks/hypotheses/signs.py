"""τ, θ, or both with the opposite sign on one joint or all; τ more often than θ."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from flexviz.checks.faults import Case, Fault, hypothesis
from flexviz.checks.reading import Reading
from flexviz.checks.thresholds import LIMITS
from flexviz.data.logs import Fix


@hypothesis
def signs(case: Case) -> Iterator[Fault]:
    names = case.mapping.names
    for joints in case.groups_of_joints:
        minus = case.at(joints, -1.0)
        theta, tau = (
            tuple(
                Fix(names[j], signal, "sign", -getattr(case.mapping.joints[names[j]], signal).sign)
                for j in joints
            )
            for signal in ("theta", "tau")
        )

        def of_tau(now: Reading, minus: np.ndarray = minus) -> Reading:
            return replace(now, sign=now.sign * minus)

        def of_theta(now: Reading, minus: np.ndarray = minus) -> Reading:
            return replace(now, factor=now.factor * minus, zero=now.zero * minus)

        def of_both(now: Reading, minus: np.ndarray = minus) -> Reading:
            turned = replace(now, factor=now.factor * minus, zero=now.zero * minus)
            return replace(turned, sign=now.sign * minus)

        rarer = float(np.log(LIMITS.rarer))
        yield Fault("sign", joints, "tau", of_tau, fixes=tau)
        yield Fault("sign", joints, "theta", of_theta, fixes=theta, prior=rarer)
        yield Fault("sign", joints, "theta and tau", of_both, fixes=theta + tau, prior=rarer)
