"""Gains of the extended-state observer set by hand, against closed forms and the paper's equations."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm, solve_continuous_lyapunov

from flexviz.analysis.identification import ResidualPreview, identify
from flexviz.base.errors import InputError
from flexviz.content.session import Session, open_session, save_session
from flexviz.data.measurements import Segment, read_set
from flexviz.data.noise import segments_noise
from flexviz.model.observers import EsoGains, binomial_gains, eso_poles, make_observer, why_unusable
from tests.small_set import write_small_set

W, STEP = 40.0, 1e-3
# poles at −20 ± 30i, −50 ± 10i, −40 and −90 rad/s
POLES = np.array([-20 + 30j, -20 - 30j, -50 + 10j, -50 - 10j, -40, -90])
GAINS = np.poly(POLES).real[1:]


def test_poles_are_those_the_gains_were_made_from():
    np.testing.assert_allclose(eso_poles(binomial_gains(W)), np.full(6, -W), rtol=1e-12)
    np.testing.assert_allclose(np.sort_complex(eso_poles(GAINS)), np.sort_complex(POLES), rtol=1e-6)
    gains = EsoGains.of(GAINS)
    assert gains.bandwidth == pytest.approx(np.prod(np.abs(POLES)) ** (1 / 6))
    moved = eso_poles(gains.scaled(2 * gains.bandwidth).theta)
    np.testing.assert_allclose(np.sort_complex(moved), np.sort_complex(2 * POLES), rtol=1e-6)


@pytest.mark.parametrize("w", [5.0, 40.0, 2000.0])
def test_equal_poles_by_hand_are_the_observer_itself(w):
    rng = np.random.default_rng(2)
    y = np.cumsum(rng.standard_normal((3000, 2)), axis=0)
    plain, by_hand = make_observer("eso", w), make_observer("eso", gains=EsoGains.of(binomial_gains(w)))
    assert by_hand.bandwidth == pytest.approx(w) and by_hand.settling() == pytest.approx(plain.settling())
    for k, (one, other) in enumerate(
        zip(*(o.derivatives(y, STEP, 5) for o in (plain, by_hand)), strict=True)
    ):
        np.testing.assert_allclose(other, one, rtol=0, atol=1e-9 * np.abs(one).max(), err_msg=str(k))
    omega = w * np.array([0.1, 1.0, 30.0])  # the plain one loses digits below
    for k in range(5):
        np.testing.assert_allclose(by_hand.transfer(omega, k), plain.transfer(omega, k), rtol=1e-6)
    np.testing.assert_allclose(by_hand.noise_gain(STEP), plain.noise_gain(STEP), rtol=1e-6)


def exact(gains, y):
    """The paper's equations with y a straight line between samples, in units of w^(i−1)."""
    w = gains[-1] ** (1 / 6)
    scaled = gains / w ** np.arange(1, 7)
    big = np.zeros((8, 8))
    big[:6, :6] = w * STEP * (np.eye(6, k=1) - np.outer(scaled, np.eye(6)[0]))
    big[:6, 6], big[6, 7] = w * STEP * scaled, 1.0
    phi = expm(big)
    x = np.zeros((len(y), 6))
    x[0, 0] = y[0]
    for k in range(len(y) - 1):
        x[k + 1] = phi[:6, :6] @ x[k] + phi[:6, 6] * y[k] + phi[:6, 7] * (y[k + 1] - y[k])
    return x * w ** np.arange(6)


def test_gains_of_theta_and_tau_apart_solve_the_papers_equations():
    t = STEP * np.arange(2000)
    theta, tau = np.sin(3 * t) + 0.2 * np.cos(11 * t), 5 * np.cos(4 * t)
    others = 1.5 ** np.arange(1, 7) * GAINS
    observer = make_observer("eso", gains=EsoGains.of(GAINS, others))
    states = observer.states(Segment(t, theta[:, None], tau[:, None], STEP))
    x, z = exact(GAINS, theta), exact(others, tau)
    for k in range(5):
        np.testing.assert_allclose(states.theta[k, :, 0], x[:, k], rtol=0, atol=1e-8 * np.abs(x[:, k]).max())
    assert states.disturbance is not None
    np.testing.assert_allclose(states.disturbance[:, 0], x[:, 5], rtol=0, atol=1e-8 * np.abs(x[:, 5]).max())
    for k in range(3):
        np.testing.assert_allclose(states.tau[k, :, 0], z[:, k], rtol=0, atol=1e-8 * np.abs(z[:, k]).max())


@pytest.mark.parametrize("gains", [GAINS, binomial_gains(W)])
def test_noise_gain_is_that_of_the_lyapunov_equation(gains):
    """White noise of density 1 into ẋ = A x + b y gives the covariance P with A P + P Aᵀ + b bᵀ = 0."""
    w = gains[-1] ** (1 / 6)
    scaled = gains / w ** np.arange(1, 7)
    a = w * (np.eye(6, k=1) - np.outer(scaled, np.eye(6)[0]))
    covariance = solve_continuous_lyapunov(a, -(w**2) * np.outer(scaled, scaled))
    observer = make_observer("eso", gains=EsoGains.of(gains))
    omega = np.geomspace(1e-3, 1e7, 100_001)
    for k in range(5):
        density = np.abs(observer.transfer(omega, k)) ** 2
        variance = np.trapezoid(density, omega) / np.pi
        assert variance == pytest.approx(covariance[k, k] * w ** (2 * k), rel=1e-3)
    white = np.random.default_rng(5).standard_normal((200_000, 1))
    spread = observer.derivatives(white, STEP, 5)[:, 5000:, 0].std(axis=1)
    np.testing.assert_allclose(spread, observer.noise_gain(STEP), rtol=0.05)


def test_bandwidths_scale_gains_also_per_joint():
    rng = np.random.default_rng(4)
    y = rng.standard_normal((1500, 2))
    gains = EsoGains.of(GAINS)
    both = make_observer("eso", [30.0, 60.0], gains).derivatives(y, STEP, 4)
    for j, w in enumerate((30.0, 60.0)):
        alone = make_observer("eso", gains=gains.scaled(w)).derivatives(y[:, j : j + 1], STEP, 4)[:, :, 0]
        np.testing.assert_allclose(both[:, :, j], alone, rtol=0, atol=1e-9 * np.abs(alone[3]).max())


def test_gains_far_above_the_sampling_rate_are_refused():
    y = np.random.default_rng(0).normal(size=(100, 1))
    plain = make_observer("eso", 1500.0).derivatives(y, 0.01, 3)
    by_hand = make_observer("eso", gains=EsoGains.of(binomial_gains(1500.0)))
    np.testing.assert_allclose(
        by_hand.derivatives(y, 0.01, 3)[2], plain[2], atol=1e-5 * np.abs(plain[2]).max()
    )
    with pytest.raises(InputError, match=r"a sample every 0\.02 s: expected at most 1000 rad/s"):
        by_hand.derivatives(y, 0.02, 3)


@pytest.mark.parametrize(
    ("observer", "gains"), [("butterworth-zero-phase", None), ("eso", EsoGains.of(GAINS))]
)
def test_every_joint_has_the_noise_floor_of_its_own_bandwidth(tmp_path, observer, gains):
    """Against noise added to the measured samples of a fixed model."""
    measurements = read_set(write_small_set(tmp_path / "set"))
    (group,) = (g for g in measurements.groups if g.name == "g1")
    fit = identify(
        measurements, groups=["g1"], observer=observer, bandwidth=[30.0, 70.0], gains=gains, max_iterations=2
    )
    sigma, rng = segments_noise(group.segments), np.random.default_rng(0)

    def noisy(segment, added):
        theta, tau = (added * s * rng.normal(size=segment.theta.shape) for s in sigma)
        return replace(segment, theta=segment.theta + theta, tau=segment.tau + tau)

    def seen(added):
        part = replace(group, segments=tuple(noisy(segment, added) for segment in group.segments))
        return ResidualPreview(measurements, part, fit.model).at(fit.observer)

    plain = seen(0.0)
    change = [seen(1.0).residual - plain.residual for _ in range(6)]
    rms = np.sqrt(np.mean(np.square(change), axis=(0, 1)))
    np.testing.assert_allclose(fit.noise_in("g1"), rms, rtol=0.15)
    np.testing.assert_allclose(plain.noise_floor, rms, rtol=0.15)


def test_unstable_gains_are_refused_and_explained():
    assert why_unusable(GAINS.tolist()) is None
    unstable = np.poly([*POLES[2:], 3 + 30j, 3 - 30j]).real[1:]
    assert np.all(unstable > 0)
    why = why_unusable(unstable.tolist())
    assert why is not None and why.values["pole"] == pytest.approx((3.0, 30.0)) and "3 ± 30i" in why.text
    for bad, text in (
        (unstable, "unstable"),
        (GAINS[:5], "expected 6"),
        (-GAINS, "β1"),
        (GAINS * np.inf, "β1"),
    ):
        with pytest.raises(InputError, match=text):
            EsoGains.of(GAINS, bad)
    with pytest.raises(InputError, match="no gains to set"):
        make_observer("butterworth-zero-phase", gains=EsoGains.of(GAINS))


def test_they_are_used_saved_and_shown(tmp_path):
    measurements = read_set(write_small_set(tmp_path / "set"))
    others = 1.5 ** np.arange(1, 7) * GAINS
    gains = EsoGains.of(GAINS, others)
    result = identify(measurements, observer="eso", gains=gains, max_iterations=3, refine=False)
    assert result.gains == gains.scaled(gains.bandwidth) and result.bandwidth == gains.bandwidth
    plain = identify(measurements, observer="eso", bandwidth=gains.bandwidth, max_iterations=3, refine=False)
    assert abs(result.residual.rms[0] / plain.residual.rms[0] - 1) > 0.01
    shown = result.document()
    assert read_json_back(shown).observer == shown.observer
    assert "gains β1 … β6 set by hand: 270, " in result.summary() and "(θ), 405, " in result.summary()

    # the preview repeats the residual and the noise of the fit, with its own observer
    group = measurements.fit_groups[0]
    alone = identify(
        measurements, groups=[group.name], observer="eso", gains=gains, max_iterations=3, refine=False
    )
    preview = ResidualPreview(measurements, group, alone.model)
    seen = preview.at(alone.observer)
    own = alone.residuals[group.name].residual
    np.testing.assert_allclose(seen.rms, np.sqrt(np.mean(own**2, axis=0)), rtol=1e-6)
    preview.at(make_observer("butterworth-zero-phase", 30.0))  # and keeps nothing of another observer
    np.testing.assert_array_equal(preview.at(alone.observer).residual, seen.residual)
    np.testing.assert_allclose(seen.noise_floor, alone.noise_in(group.name), rtol=0.02)

    session = Session.of(measurements)
    analysis = session.analysis.with_fit(observer="eso", gains=gains)
    fitted = analysis.with_identification(result, analysis.settings)
    save_session(session.then("gains", fitted), measurements, tmp_path / "session")
    again = open_session(tmp_path / "session").session.analysis
    assert again.identification is not None
    assert again.fit.gains == gains and again.up_to_date and again.identification.gains == result.gains
    # and an unstable set in the file is refused in one line
    file = tmp_path / "session" / "session.json"
    file.write_text(file.read_text().replace(repr(gains.theta[4]), "1.0"))
    with pytest.raises(InputError, match="unstable"):
        open_session(tmp_path / "session")


def read_json_back(document):
    return type(document).from_dict(document.to_dict())
