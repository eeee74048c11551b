"""Where the residual lives: shares against known truth, the parts against closed forms and Monte Carlo."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexviz.analysis.diagnosis.cross_validation import (
    explained,
    explained_in_time,
    make_folds,
    mean_and_error,
)
from flexviz.analysis.diagnosis.curves import fit_free_curve
from flexviz.analysis.diagnosis.fit_context import Fit, FitContext
from flexviz.analysis.diagnosis.residual_location import locate_residual, periodogram
from flexviz.analysis.diagnosis.residuals import UNITS, chi_square, joint_residuals
from flexviz.analysis.estimation import noise_density
from flexviz.analysis.estimation.two_band import residual_noise
from flexviz.analysis.identification import identify
from flexviz.base._scipy import sp
from flexviz.base.facts import Fact
from flexviz.data.measurements import MeasurementSet, read_set
from flexviz.model.effects import choose_effects
from flexviz.model.equation import Layout
from flexviz.model.observers import ButterworthZeroPhase
from tests.cases import slow

CASES = Path(__file__).resolve().parents[3] / "shared" / "practice" / "cases"
STRETCHES = [slice(440 * k, 440 * (k + 1)) for k in range(4)]
GAPS = {0.0: 3, 0.5: 5, 0.9: 30}  # [samples] after which noise is uncorrelated
EVERYTHING = ["coulomb_friction:joint2"]  # what the demonstration's robot has

Array = np.ndarray
Law = Callable[[Array, Array, Array], Array]  # time [s], θ [rad], θ̇ [rad/s], shape (N,) each → torque


def coloured(rng: np.random.Generator, pole: float) -> Array:
    """Noise with the autocorrelation pole^lag, shape (N,)."""
    white = rng.standard_normal(STRETCHES[-1].stop + 300)
    for k in range(1, len(white)):
        white[k] += pole * white[k - 1]
    return white[300:]


def motion() -> Array:
    """A position that repeats itself but never at the same times, shape (N,)."""
    time = np.arange(440) / 50
    parts = [np.sin((1.2 + 0.3 * k) * time + k) + 0.5 * np.sin(2.7 * time) for k in range(4)]
    return np.concatenate(parts)


def fitted(measurements: MeasurementSet, effects: list[str]) -> tuple[FitContext, Fit]:
    wanted = choose_effects((*measurements.effects, *effects), measurements.joints)
    layout = Layout(measurements.joints, wanted)
    context = FitContext(measurements, layout)
    start = layout.vector(identify(measurements, effects=effects).model)
    return context, context.fit(layout, start, iterations=12)


def with_hidden(
    measurements: MeasurementSet, joint: int, law: Law, only: str | None = None
) -> MeasurementSet:
    """The set of a robot with one more torque against a motor, which its controller overcame."""
    velocity = ButterworthZeroPhase(2 * np.pi * 40)
    groups = []
    for group in measurements.groups:
        segments = []
        for segment in group.segments:
            theta = velocity.derivatives(segment.theta, segment.step, 2, position=True)[:, :, joint]
            tau = segment.tau.copy()
            if only in (None, group.name):
                tau[:, joint] += law(segment.time, theta[0], theta[1])
            segments.append(replace(segment, tau=tau))
        groups.append(replace(group, segments=tuple(segments)))
    return replace(measurements, groups=tuple(groups))


def bump(time: Array, theta: Array, velocity: Array) -> Array:
    return 2.0 * np.exp(-(((theta - 0.1) / 0.25) ** 2))


def patch(time: Array, theta: Array, velocity: Array) -> Array:
    return bump(time, theta, velocity) * np.tanh(velocity / 0.005)


def vibration(time: Array, theta: Array, velocity: Array) -> Array:
    return 1.5 * np.sin(2 * np.pi * 5.3 * time)


def contact(time: Array, theta: Array, velocity: Array) -> Array:
    return 3.0 * ((time > 5.0) & (time < 6.5))


def slow_friction(time: Array, theta: Array, velocity: Array) -> Array:
    return 2.0 * np.exp(-((velocity / 0.2) ** 2)) * np.tanh(velocity / 0.005)


@pytest.fixture(scope="module")
def clean(demo) -> tuple[FitContext, Fit]:
    return fitted(demo, EVERYTHING)


@pytest.fixture(scope="module")
def patched(demo) -> tuple[FitContext, Fit]:
    return fitted(with_hidden(demo, 1, patch), EVERYTHING)


# -- shares ---------------------------------------------------------------------


@pytest.mark.parametrize("pole", [0.0, 0.5, 0.9])
def test_noise_explains_nothing(pole):
    rng = np.random.default_rng(5)
    position = motion()
    used = np.ones(len(position), bool)
    index = (24 * np.argsort(np.argsort(position)) // len(position)).astype(int)
    shares = []
    for _ in range(120):
        noise = coloured(rng, pole)
        folds = make_folds(used, STRETCHES, GAPS[pole])
        group = np.repeat(np.arange(4), 440)
        by_bin = [explained(which, noise, folds).share for which in (index, group)]
        shares.append([*by_bin, explained_in_time(noise, folds).share])
    mean, error = np.mean(shares, axis=0), np.std(shares, axis=0) / np.sqrt(len(shares))
    assert np.all(np.abs(mean) < 3 * error + 1e-3), (mean, error)
    assert np.all(np.abs(mean) < 0.02)


@pytest.mark.parametrize("pole", [0.0, 0.5, 0.9])
def test_error_of_a_share_of_noise(pole):
    """Products of two blocks occur twice, each predicted by the other: √2 of what blocks alone would say."""
    rng = np.random.default_rng(4)
    position = motion()
    index = (24 * np.argsort(np.argsort(position)) // len(position)).astype(int)
    folds = make_folds(np.ones(len(position), bool), STRETCHES, GAPS[pole])
    shares, stds = [], []
    for _ in range(300):
        noise = coloured(rng, pole)
        found = explained(index, noise, folds), explained_in_time(noise, folds)
        shares.append([one.share for one in found])
        stds.append([one.std for one in found])
    ratio = np.sqrt(np.mean(np.square(stds), axis=0)) / np.std(shares, axis=0)
    assert np.all((ratio > 0.88) & (ratio < 1.25)), ratio


def test_neighbours_may_not_explain_each_other():
    """The gap between training and test is what keeps coloured noise at zero."""
    rng = np.random.default_rng(1)
    used = np.ones(STRETCHES[-1].stop, bool)
    shares = []
    for _ in range(40):
        noise = coloured(rng, 0.9)
        folds = make_folds(used, STRETCHES, 8)
        touching = replace(folds, train=np.array([folds.fold != k for k in range(len(folds.train))]))
        window = np.arange(len(noise)) // 8
        shares.append(explained(window, noise, touching).share)
    assert np.mean(shares) > 0.03


@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_share_of_a_curve(pole):
    rng = np.random.default_rng(2)
    position = motion()
    curve = np.cos(4 * position)
    index = (24 * np.argsort(np.argsort(position)) // len(position)).astype(int)
    shares, true, stds = [], [], []
    for _ in range(30):
        noise = coloured(rng, pole)
        noise *= 1.5 * curve.std() / noise.std()
        residual = curve + noise
        found = explained(index, residual, make_folds(np.ones(len(curve), bool), STRETCHES, GAPS[pole]))
        shares.append(found.share)
        true.append(np.sum(curve**2) / np.sum(residual**2))
        stds.append(found.std)
    # bins that are wide, or that some training did not see, cost a little
    assert 0.85 * np.mean(true) < np.mean(shares) < 1.03 * np.mean(true)
    assert 0.5 < np.mean(stds) / np.std(np.array(shares) - true) < 3


@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_error_of_a_binned_mean_knows_the_autocorrelation(pole):
    rng = np.random.default_rng(3)
    position = motion()
    index = (24 * np.argsort(np.argsort(position)) // len(position)).astype(int)
    squares, naive = [], []
    for _ in range(60):
        noise = coloured(rng, pole)
        folds = make_folds(np.ones(len(noise), bool), STRETCHES, GAPS[pole])
        mean, std, count = mean_and_error(index, noise, 24, folds)
        squares.append(np.mean((mean / std) ** 2))
        naive.append(np.mean(mean**2 * count) / noise.var())
    assert 0.8 < np.mean(squares) < 1.25
    assert pole == 0.0 or np.mean(naive) > 3.0


# -- noise floor ----------------------------------------------------------------


def test_density_of_the_floor_holds_all_of_the_noise(clean):
    context, fit = clean
    part = joint_residuals(context, fit)[0]
    two_band = part.two_band
    hertz = np.linspace(0, 30, 3000)
    step = two_band.blocks[0].segment.step
    transfer = two_band.wide.signals.observer.transfer
    density = noise_density(part.paths, two_band.noise, transfer, step, hertz)
    link = fit.point.link
    whole = residual_noise(two_band.wide.signals, fit.layout, fit.x, link, two_band.noise)
    np.testing.assert_allclose(np.trapezoid(density, hertz, axis=0), whole, rtol=2e-3)


def test_a_complete_model_is_at_the_floor(clean):
    found = locate_residual(*clean)
    assert np.all((chi_square(found.parts) > 0.8) & (chi_square(found.parts) < 1.15))
    for one in (m for m in found.maps if m.variable == "frequency"):
        assert np.median(one.mean[0] / one.mean[1]) == pytest.approx(1.0, abs=0.1)


# -- places ---------------------------------------------------------------------


@pytest.mark.parametrize("joint", [slow(0), 1])
@pytest.mark.parametrize(
    ("law", "variable", "inside"),
    # friction has two sides, and its range may be one of them
    [(bump, "position", (0.1, 0.1)), (slow_friction, "velocity", (-0.1, 0.1))],
)
def test_a_hidden_torque_is_placed(demo, joint, law, variable, inside):
    first = locate_residual(*fitted(with_hidden(demo, joint, law), EVERYTHING)).places[0]
    assert first.joint == f"joint{joint + 1}"
    assert first.variable == variable and first.explained > 0.5
    assert first.range[0] < inside[1] and inside[0] < first.range[1]


def test_position_and_direction_together(patched):
    first = locate_residual(*patched).places[0]
    assert (first.joint, first.variable) == ("joint2", "position") and first.explained > 0.7
    by_name = {m.variable: m for m in locate_residual(*patched).maps if m.joint == "joint2"}
    both = by_name["position × direction"]
    assert by_name["position"].explained < 0.1 < both.explained - by_name["velocity"].explained
    assert both.curves == ("forward", "backward")
    middle = np.argmin(np.abs(both.centres - 0.1), axis=1)
    forward, backward = both.mean[0, middle[0]], both.mean[1, middle[1]]
    assert forward > 5 * both.std[0, middle[0]] > 0 > backward


@pytest.mark.parametrize("count", [100, 101])
def test_density_of_a_spectrum(count):
    values = np.random.default_rng(3).normal(size=(2, count, 3))
    hertz, power = periodogram(values, 0.01)
    expected = sp.signal.periodogram(values, 100.0, "hann", detrend=False, axis=1)
    np.testing.assert_allclose(hertz, expected[0])
    np.testing.assert_allclose(power, expected[1], atol=1e-15)


def test_a_vibration_has_a_frequency(demo):
    first = locate_residual(*fitted(with_hidden(demo, 0, vibration), EVERYTHING)).places[0]
    assert (first.joint, first.variable) == ("joint1", "frequency")
    assert first.range[0] < 5.3 < first.range[1] and first.explained > 0.5


def test_a_contact_has_a_time_and_a_group(demo):
    name = demo.fit_groups[1].name
    context, fit = fitted(with_hidden(demo, 1, contact, only=name), EVERYTHING)
    first = locate_residual(context, fit).places[0]
    assert (first.joint, first.variable) == ("joint2", "time")
    assert 4.5 < first.range[0] < first.range[1] < 7.0  # it lasts from 5.0 to 6.5 s
    by_time = next(
        m for m in locate_residual(context, fit).maps if (m.joint, m.variable) == ("joint2", "time")
    )
    assert max(by_time.explained_by_group, key=lambda g: by_time.explained_by_group[g]) == name


def test_a_complete_model_has_no_place(clean):
    assert all(
        abs(p.explained) < (0.25 if p.variable == "frequency" else 0.1)
        for p in locate_residual(*clean).places
    )


def test_maps_have_every_variable(clean):
    found = locate_residual(*clean).maps
    assert sorted((m.joint, m.variable) for m in found) == sorted(
        (j, v) for j in ("joint1", "joint2") for v in UNITS
    )
    for m in found:
        assert m.centres.shape == m.mean.shape == m.std.shape == m.count.shape
        assert m.mean.shape[0] == len(m.curves)


# -- free-form curve ------------------------------------------------------------


def test_free_form_draws_the_hidden_law(patched):
    context, fit = patched
    curve = fit_free_curve(context, fit, locate_residual(context, fit).places[0])
    assert (curve.joint, curve.variable) == ("joint2", "position") and curve.note == Fact("curve-not-physics")
    assert curve.directions == ("forward", "backward") and curve.explained > 0.9
    truth = 2.0 * np.exp(-(((curve.centres - 0.1) / 0.25) ** 2))
    for sign, value, std in zip((1, -1), curve.value, curve.std, strict=True):
        seen = np.isfinite(value)
        error = value[seen] - sign * truth[seen]
        # a part that does not change along the way is the model's own Coulomb friction
        assert error.std() < 0.12 and abs(error.mean()) < 0.5
        assert 0.003 < np.median(std[seen]) < 0.1
    form = curve.simple_form()
    assert form is not None and form.fact == curve.form and (form.kind, form.direction) == ("bump", "against")
    assert abs(form.values["centre"] - 0.1) < 0.03 and abs(form.values["width"] - 0.25) < 0.05
    assert abs(form.values["size"] - 2.0) < 0.3


def test_free_form_of_noise_is_nothing(clean):
    context, fit = clean
    place = next(p for p in locate_residual(context, fit).places if p.variable == "position")
    curve = fit_free_curve(context, fit, place)
    seen = np.isfinite(curve.value)
    assert abs(curve.explained) < 0.1
    assert np.mean(np.abs(curve.value[seen]) < 3 * curve.std[seen]) > 0.9


def test_free_form_of_a_frequency_takes_another_variable(patched):
    context, fit = patched
    place = next(
        p for p in locate_residual(context, fit).places if (p.joint, p.variable) == ("joint2", "frequency")
    )
    assert fit_free_curve(context, fit, place).variable == "position"


@pytest.mark.skipif(not CASES.exists(), reason="the practice cases are not beside this checkout")
@pytest.mark.parametrize("case", ["2r-unknown", slow("ur5-unknown")])
def test_practice(case):
    truth = json.loads((CASES.parent / "truth" / f"{case}.json").read_text())["effects"][0]
    first = locate_residual(*fitted(read_set(CASES / case), [])).places[0]
    assert (first.joint, first.variable) == (truth["joint"], "position")
    reach = 2 * truth["parameters"]["width"]
    assert abs(np.mean(first.range) - truth["parameters"]["position"]) < reach
