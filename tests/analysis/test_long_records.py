"""What a diagnosis keeps in memory grows with the length of the records, and no faster."""

from __future__ import annotations

import gc
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from flexviz.analysis.diagnosis.fine import Fine
from flexviz.analysis.diagnosis.fit_context import Fit, FitContext
from flexviz.analysis.diagnosis.residuals import joint_residuals
from flexviz.analysis.estimation import least_squares, score_test, whitening
from flexviz.analysis.estimation.noise_weighting import NoiseWeighting
from flexviz.analysis.estimation.whitening import Whitener
from flexviz.analysis.motion import MotionContext, MotionFit
from flexviz.analysis.motion import samples as motion_samples
from flexviz.base.recent import Recent
from flexviz.base.resources import sessions_dir
from flexviz.data.measurements import read_set
from flexviz.model.effects import ChosenEffect
from flexviz.model.equation import Layout, PulseGroup, Pulses, fine_signals, pulses, reversal_nuisance
from flexviz.model.equation.fine_signals import FineSignals

COULOMB = ChosenEffect("coulomb_friction", 1)


@pytest.fixture(scope="module")
def context() -> FitContext:
    measurements = read_set(sessions_dir() / "planar-2r-demo")
    return FitContext(measurements, Layout(measurements.joints))


def x_of(context: FitContext) -> tuple[Layout, np.ndarray]:
    layout = Layout(context.measurements.joints, (COULOMB,))
    x = context.start(layout).x.copy()
    x[layout.effect_slice(COULOMB)] = 0.5
    return layout, x


def some_whitener(count: int, n: int = 2, order: int = 5) -> Whitener:
    rng = np.random.default_rng(0)
    at = np.unique(np.r_[np.arange(order), np.arange(order, count, 7), count - 1])
    weights = 0.1 * rng.standard_normal((order, len(at), n, n))
    return Whitener(at, weights, np.eye(n) + 0.1 * rng.standard_normal((len(at), n, n)))


def dense(tool: Whitener, count: int, n: int = 2) -> np.ndarray:
    """W as a matrix, sample by sample."""
    out = np.zeros((count, n, count, n))
    predictor, scale = tool.maps(np.arange(count))
    for t in range(count):
        out[t, :, t] = scale[t]
        for k in range(min(t, tool.order)):
            out[t, :, t - 1 - k] = -scale[t] @ predictor[k, t]
    return out.reshape(count * n, count * n)


def test_whitening_takes_little_more_memory_than_its_result() -> None:
    tool, y = some_whitener(4000), np.ones((4000, 2, 100))
    tracemalloc.start()
    white = tool.apply(y)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1.3 * white.nbytes


@pytest.mark.parametrize(("samples_wanted", "stride"), [(1.0, 1), (1 / 2.1, 2), (1 / 30, 3)])
def test_a_long_slow_record_has_about_as_many_samples_as_it_may(
    context: FitContext, monkeypatch: pytest.MonkeyPatch, samples_wanted: float, stride: int
) -> None:
    """Of 100 Hz every sample, every second one, and no fewer than the band of the motion needs."""
    measurements = context.measurements
    groups = []
    for group in measurements.groups:
        slow = tuple(
            replace(s, time=s.time[::10], theta=s.theta[::10], tau=s.tau[::10], step=10 * s.step)
            for s in group.segments
        )
        groups.append(replace(group, segments=slow))
    fitted = [s for g in groups if not g.validation for s in g.segments]
    raw = round(sum(float(np.ptp(s.time)) for s in fitted) / 0.01)
    monkeypatch.setattr(motion_samples, "SAMPLES", int(raw * samples_wanted))
    monkeypatch.setattr(motion_samples, "HERTZ", 8.0)  # sampled every 16 ms if the record were short
    found = MotionContext(replace(measurements, groups=tuple(groups)), measurements.joints)
    assert {block.stride for block in found.signals.blocks} == {stride}


def test_normal_equations_of_some_samples_at_a_time(
    context: FitContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    layout, x = x_of(context)
    point = context.two_band.with_layout(layout).narrow.at(x)
    now, prior = point.evaluate(x), context.start(layout).prior
    weights = np.random.default_rng(0).uniform(0.5, 2.0, now.residual.shape)
    place = least_squares.Solution(x, point, now, weights, 0.0, np.zeros(len(x), bool), False)
    whole = least_squares.normal_equations(place, prior)
    monkeypatch.setattr(least_squares, "SAMPLES_TOGETHER", 100)
    parts = least_squares.normal_equations(place, prior)
    for part, exact in ((parts.gradient, whole.gradient), (parts.hessian, whole.hessian)):
        np.testing.assert_allclose(part, exact, atol=1e-12 * np.abs(exact).max())


def test_candidates_of_a_long_record_are_scored_fewer_at_a_time(
    context: FitContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    layout, x = x_of(context)
    fit = context.fit(layout, x, iterations=1)
    view = Fine(context, Layout(layout.joints), lambda text: None)
    wanted = view.wanted(layout)
    whole = view.scores(fit, wanted, episodes=False)
    monkeypatch.setattr(score_test, "MAX_BATCH_NUMBERS", 1.0)
    parts = view.scores(fit, wanted, episodes=False)
    assert [s.effect for s in parts] == [s.effect for s in whole]
    np.testing.assert_allclose([s.gain for s in parts], [s.gain for s in whole], rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("chunk", [3, 16, 1000])
def test_whitening_in_chunks_is_whitening(monkeypatch: pytest.MonkeyPatch, chunk: int) -> None:
    count = 60
    tool = some_whitener(count)
    matrix = dense(tool, count)
    monkeypatch.setattr(whitening, "CHUNK", chunk)
    y = np.random.default_rng(1).standard_normal((count, 2, 3))
    flat = y.reshape(-1, 3)
    np.testing.assert_allclose(tool.apply(y).reshape(-1, 3), matrix @ flat, atol=1e-12)
    np.testing.assert_allclose(tool.transposed(y).reshape(-1, 3), matrix.T @ flat, atol=1e-12)
    late = tool.apply(y[20:], 20)
    y[:20] = 0.0
    np.testing.assert_allclose(late, tool.apply(y)[20:], atol=1e-12)


def test_unknown_columns_are_whitened_and_kept_without_their_zeros() -> None:
    count, pulses_ = 400, 40
    tool = some_whitener(count)
    columns = np.zeros((count, 2, pulses_))
    for k in range(pulses_):
        columns[10 * k : 10 * k + 6, :, k] = np.random.default_rng(k).standard_normal((6, 2))
    groups = [
        PulseGroup(10 * k, columns[10 * k : 10 * (k + 4) - 4, :, k : k + 4]) for k in range(0, pulses_, 4)
    ]
    # an unknown initial state lasts for long, beside all others
    lasting = np.random.default_rng(2).standard_normal((count, 2, 1))
    columns, pulses_ = np.concatenate((columns, lasting), axis=2), pulses_ + 1
    weighting = NoiseWeighting(tool).with_unknown([*groups, PulseGroup(0, lasting)], slice(0, count))
    white = dense(tool, count) @ columns.reshape(-1, pulses_)
    matrix = np.eye(2 * count) + white @ white.T
    y = np.random.default_rng(1).standard_normal((count, 2, 3))
    found = weighting.apply(y).reshape(-1, 3)
    values, vectors = np.linalg.eigh(matrix)
    exact = vectors @ ((vectors.T @ (dense(tool, count) @ y.reshape(-1, 3))) / np.sqrt(values)[:, None])
    np.testing.assert_allclose(found, exact, atol=1e-9)
    by_columns = weighting.apply(np.asfortranarray(y)).reshape(-1, 3)
    np.testing.assert_allclose(by_columns, exact, atol=1e-9)
    assert weighting.log_determinant == pytest.approx(np.log(values).sum(), rel=1e-9)
    kept = sum(part.size for _, part in weighting.unknown[0].columns)
    assert kept < 0.2 * white.size


def test_the_pulses_of_a_long_stretch_take_memory_with_its_length(
    context: FitContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    layout, x = x_of(context)
    two_band = context.two_band.with_layout(layout)
    here = two_band.evaluate(x)
    whiteners = two_band.whiteners(x, here.link)

    def found() -> tuple[list[Pulses], np.ndarray]:
        weightings = two_band.weightings(here, whiteners)
        white = [w.apply(here.residual[b.rows]) for w, b in zip(weightings, two_band.blocks, strict=True)]
        return pulses(here.wide_point, x, here.link), np.concatenate(white)

    whole, white = found()
    monkeypatch.setattr(reversal_nuisance, "LONGEST", 6.0)
    monkeypatch.setattr(reversal_nuisance, "PART", 3.0)
    parts, white_in_parts = found()
    for block in {p.block for p in whole}:
        rows = [p.rows for p in parts if p.block == block]
        seen = np.concatenate([np.arange(r.start, r.stop) for r in rows])
        count = two_band.blocks[block].rows.stop - two_band.blocks[block].rows.start
        assert len(rows) > 2 and len(set(seen)) == len(seen)
        pulses_in = [p.count for p in parts if p.block == block]
        most = next(p.count for p in whole if p.block == block)
        assert sum(pulses_in) >= most or len(seen) < count  # none is lost; those at a border are in both
    sizes = [[g.columns.size for p in some for g in p.groups] for some in (parts, whole)]
    assert sum(sizes[0]) < 1.5 * sum(sizes[1])  # those at a border are in both
    assert sum(sizes[1]) < 0.3 * sum(p.dense(0).size for p in whole) * layout.n
    error = np.sqrt(np.mean((white_in_parts - white) ** 2) / np.mean(white**2))
    assert error < 0.05


def test_residuals_for_inspection_of_a_long_stretch(
    context: FitContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    layout, x = x_of(context)
    fit = context.fit(layout, x, iterations=3)
    whole = joint_residuals(context, fit)
    monkeypatch.setattr(reversal_nuisance, "LONGEST", 6.0)
    monkeypatch.setattr(reversal_nuisance, "PART", 3.0)
    for one, other in zip(joint_residuals(context, fit), whole, strict=True):
        for name, close in {"white": 0.1, "slow": 0.2}.items():  # they differ at the borders of the parts
            exact = getattr(other, name)
            error = getattr(one, name) - exact
            assert np.sqrt(np.mean(error**2)) < close * np.sqrt(np.mean(exact**2))


def test_only_the_last_instruments_are_kept_and_made_again_alike(context: FitContext) -> None:
    layout, x = x_of(context)
    fits = [context.fit(layout, x * (1 + 1e-4 * k), iterations=0) for k in range(4)]
    first = fits[0].point.z.copy()
    for fit in fits:
        fit.point.z  # noqa: B018
    kept = [fit.point._instruments._part is not None for fit in fits]
    assert kept == [False, False, True, True]
    np.testing.assert_allclose(fits[0].point.z, first, rtol=0, atol=1e-12 * np.abs(first).max())
    assert all(fit.held_out is not None and fit.held_out._instruments._part is None for fit in fits)


def test_what_is_gone_is_not_counted() -> None:
    parts: list[Recent[int]] = [Recent("test", 2) for _ in range(3)]
    made: list[int] = []
    for k, part in enumerate(parts):
        assert part.get(lambda k=k: made.append(k) or k) == k
    assert parts[2].get(lambda: -1) == 2 and parts[1].get(lambda: -1) == 1
    assert parts[0].get(lambda: -2) == -2


@pytest.mark.parametrize("kind", ["search", "backwards"])
def test_fits_that_are_kept_hold_no_wide_band_signals(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each has its own, as their bands follow its stiffness; a search keeps dozens of fits."""
    monkeypatch.setattr(fine_signals, "KEPT_BYTES", 1.0)
    measurements = read_set(sessions_dir() / "planar-2r-demo")
    own = Layout(measurements.joints)
    context = FitContext(measurements, own) if kind == "search" else MotionContext(measurements, own.joints)
    layout = Layout(own.joints, (COULOMB,))

    def fit(factor: float) -> Fit | MotionFit:
        x = context.start(layout).x.copy()
        x[layout.compliance] *= factor
        x[layout.effect_slice(COULOMB)] = 0.5
        return context.fit(layout, x, iterations=0)

    fit(1.0)
    gc.collect()
    before = {id(one) for one in gc.get_objects() if isinstance(one, FineSignals)}
    fits = [fit(factor) for factor in (0.1, 0.3, 3.0, 10.0)]
    gc.collect()
    alive = [one for one in gc.get_objects() if isinstance(one, FineSignals) and id(one) not in before]
    most = len(measurements.groups)  # those of the last fit, in the fit and the validation groups
    assert len(fits) == 4 and len(alive) <= most


def test_of_large_parts_only_some_bytes_are_kept() -> None:
    """What is gone does not count, and the last one stays whatever its size."""

    def kept(sizes: list[int]) -> list[bool]:
        parts = [Recent[int](f"test {sizes}", 4, lambda size: size, 10.0) for _ in sizes]
        for part, size in zip(parts, sizes, strict=True):
            part.get(lambda size=size: size)
        return [part._part is not None for part in parts]

    assert kept([3, 3, 3]) == [True, True, True]
    assert kept([3, 3, 3, 3]) == [False, True, True, True]
    assert kept([1, 1, 1, 1, 1]) == [False, True, True, True, True]
    assert kept([3, 3, 20]) == [False, False, True]
    gone, left, last = (Recent[int]("test of size", 4, lambda size: size, 10.0) for _ in range(3))
    gone.get(lambda: 9)
    del gone
    left.get(lambda: 9)
    last.get(lambda: 1)
    assert left._part == 9
