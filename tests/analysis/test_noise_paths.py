"""Noise of the residual as predicted against draws."""

from dataclasses import replace

import numpy as np
import pytest

from flexviz.analysis.estimation.noise_propagation import noise_paths
from flexviz.analysis.estimation.whitening import noise_kernel, paths_covariance
from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import ChosenEffect
from flexviz.model.equation import Equation, Layout, LinkTerms, OperatingPoint, build_signals
from flexviz.model.observers import FlatZeroPhase
from flexviz.robot.robot import Robot
from tests.model.test_equation import made_up_set, point


@pytest.mark.parametrize(
    "effect, sharp, loud",
    [
        ("", False, 1),
        ("joint_damping", False, 1),
        ("joint_damping", True, 1),
        ("joint_damping", True, 20),
        ("stiffness_hardening", True, 1),
        ("stiffness_hardening", True, 20),
    ],
)
def test_noise_on_its_ways_against_noise(effect: str, sharp: bool, loud: int):
    """The residual's variance from white noise in the records against draws, through such joints, too.

    Of loud noise, effects see the transmission torque in a narrower band than the observer's.
    """
    robot = Robot.load("robots:planar_2r")
    whole = made_up_set(robot, "link2", seconds=6.0)
    quiet = replace(whole, groups=whole.groups[:1])
    layout = Layout(robot.joints, (ChosenEffect(effect, 0),) if effect else ())
    x = point(layout, robot)
    stiffness = 1 / x[layout.compliance][0]
    if effect:  # a time constant of 12 ms, or half the compliance at the largest load of 180 Nm
        x[-1] = {"joint_damping": 0.012 * stiffness, "stiffness_hardening": 0.3 * stiffness**3 / 180**2}[
            effect
        ]
    observer, noise = (
        FlatZeroPhase(2 * np.pi * 14),
        (loud * np.array([4e-5, 2e-5]), loud * np.array([4e-3, 2e-3])),
    )
    rng = np.random.default_rng(3)

    def prepared(measurements: MeasurementSet) -> OperatingPoint:
        signals = build_signals(
            measurements, measurements.groups, observer, sample_step=0.02, exact_step=True, drop=(0.4, 0.4)
        )
        return Equation(robot, replace(signals, sharp=sharp), layout).at(x)

    def drawn() -> MeasurementSet:
        group = quiet.groups[0]
        segment = group.segments[0]
        theta, tau = (noise[k] * rng.standard_normal(segment.theta.shape) for k in (0, 1))
        noisy = replace(segment, theta=segment.theta + theta, tau=segment.tau + tau)
        return replace(quiet, groups=(replace(group, segments=(noisy,)),))

    still = prepared(quiet)
    residual, link = still.residual(x), prepared(drawn()).link_terms(x)
    found = np.mean([np.mean((prepared(drawn()).residual(x) - residual) ** 2, axis=0) for _ in range(30)], 0)
    block = still.signals.blocks[0]
    steps = (block.segment.step * block.stride, block.segment.step)

    def predicted(model: Layout, link: LinkTerms = link) -> np.ndarray:
        ways = noise_paths(model, x[: model.size], link)
        kernels = [noise_kernel(observer, *steps, way.derivatives, 0) for way in ways]
        return paths_covariance(ways, kernels, noise, block.rows)[0].mean(axis=0).diagonal()

    np.testing.assert_allclose(found, predicted(layout), rtol=0.08)
    if effect and loud == 1:  # and it matters
        assert predicted(Layout(robot.joints))[0] > 1.15 * found[0]
    if effect == "joint_damping":
        wrong = replace(link, seen=np.full(2, 0.0 if sharp and loud == 1 else np.inf))
        assert np.all(np.abs(found - predicted(layout)) < 0.5 * np.abs(found - predicted(layout, wrong)))
