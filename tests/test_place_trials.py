"""Which fits beside an unknown input are made, and from where, to find its place."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from flexviz.diagnosis.unknown_place import unknown_place

from flexviz.diagnosis import unknown_place as module
from flexviz.diagnosis.fit_context import FitContext
from flexviz.equation import Layout
from flexviz.estimation import UnknownInput

# where a fit starts: of a rigid robot, of the present model, of an input
RIGID, FITTED, BESIDE = 1.0, 2.0, 3.0


class Made:
    """A context whose fits beside an input leave what `outcome` says, by input and start."""

    def __init__(self, outcome: Callable[[UnknownInput, float], tuple[float, bool]]) -> None:
        self.outcome, self.asked = outcome, list[tuple[UnknownInput, float, int]]()
        tau = np.ones((1, 4, 2))
        self.two_band = SimpleNamespace(narrow=SimpleNamespace(signals=SimpleNamespace(tau=tau)))

    def start(self, layout: Layout) -> Any:
        return SimpleNamespace(x=np.array([RIGID]))

    def with_unknown_input(self, unknown: UnknownInput) -> Any:
        def fit(layout: Layout, x: np.ndarray, *, iterations: int, check: Any) -> Any:
            self.asked.append((unknown, x[0], iterations))
            left, converged = self.outcome(unknown, x[0])
            return SimpleNamespace(left=left, converged=converged, x=np.array([BESIDE]))

        return SimpleNamespace(fit=fit)


def place_of(made: Made, lacking: float, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(module, "excess", lambda fit: fit.left)
    fit: Any = SimpleNamespace(layout=Layout(("joint1", "joint2")), x=np.array([FITTED]), left=lacking)
    return unknown_place(cast(FitContext, made), fit, lambda: None)


@pytest.mark.parametrize(
    ("motor", "transmission", "elsewhere", "continued"),
    [
        (5.0, 5.0, 14.0, [(0, "motor"), (0, "transmission")]),  # that on joint 2 explains little
        (5.0, 5.0, 5.5, [(0, "motor"), (0, "transmission"), (1, "motor"), (1, "transmission"), (1, "link")]),
        (6.5, 5.0, 6.5, [(0, "transmission")]),  # 6.5 is far more than the 0.6 that others leave at least
        (0.5, 5.0, 14.0, [(0, "motor")]),  # the side is not sure any more, whatever the third one leaves
    ],
)
def test_near_the_noise_fits_beside_an_input_start_from_the_model_and_hopeless_ones_end(
    motor: float,
    transmission: float,
    elsewhere: float,
    continued: list[tuple[int, str]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    on_joint_1 = {"motor": (motor, False), "transmission": (transmission, False), "link": (0.1, True)}

    def outcome(unknown: UnknownInput, x: float) -> tuple[float, bool]:
        return on_joint_1[unknown.side] if unknown.joint == 0 else (elsewhere, False)

    made = Made(outcome)
    place = place_of(made, 16.0, monkeypatch)
    assert place.unknown.side == "link" and place.unknown.joint == 0 and place.sure == (motor > 0.6)
    first, more = made.asked[:6], made.asked[6:]
    assert {x for _, x, _ in first} == {FITTED}
    assert [(u.joint, u.side) for u, _, _ in more] == continued and {x for _, x, _ in more} == {BESIDE}


@pytest.mark.parametrize(("there", "sure"), [(0.1, False), (50.0, True)])
def test_a_side_whose_fit_went_astray_is_tried_from_where_another_explains_all(
    there: float, sure: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What leaves more than no input at all says nothing about its side."""

    def outcome(unknown: UnknownInput, x: float) -> tuple[float, bool]:
        if unknown.joint == 0 and unknown.side == "link":
            return 0.1, True
        if unknown.joint == 0 and x == BESIDE:
            return there, True
        return 1e5, True

    made = Made(outcome)
    place = place_of(made, 100.0, monkeypatch)
    assert place.unknown.side == "link" and place.sure == sure
    assert {x for _, x, _ in made.asked[:6]} == {RIGID}
    assert [(u.joint, u.side, x) for u, x, _ in made.asked[6:]] == [
        (1, "motor", FITTED),
        (0, "motor", BESIDE),
        (0, "transmission", BESIDE),
    ]
