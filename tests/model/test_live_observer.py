"""An observer fed sample by sample gives the states that it gives for the whole record."""

from __future__ import annotations

import numpy as np
import pytest

import flexviz
from flexviz.base.arrays import Array
from flexviz.model.observers import CausalEso, EqualDelayEso, EsoGains, Observer, binomial_gains

STEP = 0.002  # [s]
ROUNDING = 1e-7  # of a state's largest value: w⁵ of the rounding of the angle
SKEWED = EsoGains.of(binomial_gains(40.0) * [1.0, 1.1, 1.0, 1.0, 1.0, 1.0], binomial_gains(30.0))


def motion() -> Array:
    """(N, 2) [rad], not at rest in the beginning."""
    time = STEP * np.arange(1500)
    noise = 1e-5 * np.random.default_rng(3).standard_normal((len(time), 2))
    return np.stack([1.0 + np.sin(3.0 * time), -2.0 + np.cos(5.0 * time)], axis=1) + noise


@pytest.mark.parametrize(
    "observer",
    [
        CausalEso(60.0),
        CausalEso([20.0, 80.0]),
        CausalEso(gains=SKEWED),
        CausalEso(gains=SKEWED).torque,
        EqualDelayEso(50.0),
    ],
)
def test_sample_by_sample_equals_the_record(observer: Observer) -> None:
    y = motion()
    live = observer.live(STEP)
    found = np.array([live.update(sample) for sample in y]).transpose(1, 0, 2)
    expected = observer.derivatives(y, STEP, 5, position=True)
    size = np.abs(expected).max(axis=(1, 2), keepdims=True)
    assert np.all(np.abs(found[:5] - expected) < ROUNDING * size)
    live.reset(y[0])
    assert np.array_equal([live.update(sample)[1] for sample in y[1:9]], found[1, 1:9])


def test_the_disturbance_is_the_record_s() -> None:
    y = motion()
    live = CausalEso(60.0).live(STEP)
    found = np.array([live.update(sample)[5] for sample in y])
    segment = flexviz.Segment(STEP * np.arange(len(y)), y, y, STEP)
    expected = CausalEso(60.0).states(segment).disturbance
    assert expected is not None and np.all(np.abs(found - expected) < ROUNDING * np.abs(expected).max())


def test_a_single_joint_takes_numbers_and_bad_samples_change_nothing() -> None:
    live, other = (flexviz.make_observer("eso", 60.0).live(STEP) for _ in range(2))
    for sample in motion()[:20, 0]:
        live.update(sample)
        other.update([sample])
    for bad, says in ((np.nan, "expected finite"), ([1.0, 2.0], r"shape \(2,\), expected \(1,\)")):
        with pytest.raises(flexviz.InputError, match=says):
            live.update(bad)
    assert np.array_equal(live.update(1.0), other.update([1.0]))


def test_who_cannot_run_live_says_so() -> None:
    with pytest.raises(flexviz.InputError, match="needs later samples"):
        flexviz.make_observer("butterworth-zero-phase").live(STEP)
    with pytest.raises(flexviz.InputError, match="2 bandwidths: expected one value per joint"):
        flexviz.make_observer("eso", [20.0, 60.0]).live(STEP).update([0.0, 0.0, 0.0])
