"""Which sets each study makes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import changed_recordings as changes
from benchmarks.diagnosis_study.cases import generator
from benchmarks.diagnosis_study.making import make_all
from benchmarks.one_truth.making import Planned, make
from benchmarks.robotlike_study.cases import cases as robot_cases
from benchmarks.robotlike_study.making import make as make_robot

JOINTS = {"2r": 2, "ur5": 6, "panda": 7}
ROBOTLIKE, ROBOTLIKE_DURATION = 20, 10.0
CLEAN = 60  # and as many with something hidden
EVERY = (10, 4, 2, 1)  # rows of 1 kHz: 100 to 1000 Hz
OF_EACH_PAIR = WORN = 10
PAIRS = (
    ("backlash", "coulomb_friction"),
    ("backlash", "friction_drift"),
    ("coulomb_friction", "torque_offset"),
    ("cable_spring", "stiffness_hardening"),  # planar arms: gravity loads the joints of others one way
)
PLACES = (("2r", True), ("2r", False), ("ur5", True), ("2r", True), ("panda", False), ("2r", False))
"""Robot, and whether it is simulated apart from flexviz; in turn."""
GAINS, TWO_GAINS, SMALLEST_GAIN, LARGEST_GAINS = 20, 10, 0.1, (-0.4, 0.5)
LATE, DELAYS = 20, (0.005, 0.020)  # [s]
CLIPPED, SHARES, CLIPPED_NOISE = 20, (0.6, 0.9), 1e-4
SMALL = {"unmodelled": 16, "two-small": 12, "good-sensors": 12}
SMALL_TORQUE = (0.004, 0.015)  # rms of a small unmodelled torque over the torque's spread
LAWS = ("rough_spot", "one_way", "vibration")
SINGLES = ("coulomb_friction", "torque_ripple", "quadratic_friction",
           "backlash", "torque_offset", "cable_spring")  # fmt: skip
FILTERS, HERTZ, BITS = 24, (8.0, 150.0), (12, 14)


def make_study(study: str, work: Path, seed: int, jobs: int, only: str = "") -> int:
    """Make the sets of a study that are not there yet; 1 if one could not be made."""
    if study == "plain_guess":
        robots = [c for c in robot_cases(seed, ROBOTLIKE, duration=ROBOTLIKE_DURATION) if only in c.name]
        return make_all(work / study, robots, make_robot, jobs)
    sets = [one for one in PLANS.get(study, lambda _: [])(seed) if only in one.name]
    return make_all(work / study, sets, make, jobs)


def _planned(seed: int, label: str, k: int, place: tuple[str, bool] | None = None, **more: Any) -> Planned:
    """A set whose robot and simulator are those whose turn it is, and its joint any."""
    robot, apart = place or PLACES[k % len(PLACES)]
    name = f"{label}-{k:02d}-{robot}{'-apart' if apart else ''}-s{seed}"
    joint = int(generator(seed, f"joint of {name}").integers(JOINTS[robot]))
    return Planned(name, seed, robot, apart, joint, **more)


def clean(seed: int) -> Iterator[Planned]:
    """Odd rates, with and without start values and the hold of the torque; and the same with an effect."""
    circumstances = product((True, False), (True, False), EVERY, (True, False), ("2r", "ur5"))
    for k, (hold, initial, every, apart, robot) in zip(range(CLEAN), circumstances, strict=False):
        told = {"hold": hold, "initial": initial, "changes": (partial(changes.thinned, every=every),)}
        effect = ("backlash", "coulomb_friction")[int(generator(seed, f"clean {k}").integers(2))]
        yield _planned(seed, "clean", k, (robot, apart), **told)
        yield _planned(seed, "hidden", k, (robot, apart), **told, hidden=(effect,), wanted=(effect,))


def two_effects(seed: int) -> Iterator[Planned]:
    """Two effects on one joint, and the worn example."""
    for number, pair in enumerate(PAIRS):
        places = [p for p in PLACES if p[0] == "2r"] if "stiffness_hardening" in pair else PLACES
        for k in range(OF_EACH_PAIR):
            place = places[(k + number) % len(places)]
            yield _planned(seed, "+".join(pair), k, place, hidden=pair, wanted=pair)
    for k in range(WORN):
        yield Planned(f"worn-{k:02d}-s{seed}", seed + k, "worn", wanted=PAIRS[0])


def torque_scale(seed: int) -> Iterator[Planned]:
    """A wrong scale of one joint's or two joints' torque, a late torque, and one that is clipped."""
    rng = generator(seed, "torque_scale")

    def gain() -> float:
        drawn = rng.uniform(*LARGEST_GAINS, 100).round(3)
        return float(drawn[np.abs(drawn) > SMALLEST_GAIN][0])

    for k in range(GAINS + TWO_GAINS):
        one = _planned(seed, "gain", k, wanted=("torque_gain",))
        joints = rng.permutation(JOINTS[one.robot])[: 1 + (k >= GAINS)].tolist()
        yield replace(one, changes=tuple(partial(changes.scaled, joint=j, gain=gain()) for j in joints))
    for k, delay in enumerate(np.linspace(*DELAYS, LATE).tolist()):
        one = _planned(seed, "late", k, wanted=("torque_delay",))
        yield replace(one, changes=(partial(changes.late, joint=one.joint, delay=delay),))
    for k, share in enumerate(np.linspace(*SHARES, CLIPPED).tolist()):
        one, noise = _planned(seed, "clipped", k, wanted=("torque_limit",)), CLIPPED_NOISE * (k % 2)
        change = partial(changes.clipped, joint=one.joint, share=share, noise=noise)
        yield replace(one, changes=(change,))


def small(seed: int) -> Iterator[Planned]:
    """What is left lies between the noise and 2 % of the torque."""
    rng = generator(seed, "small")
    for k in range(SMALL["unmodelled"]):
        effect, law = SINGLES[k % len(SINGLES)], LAWS[k % len(LAWS)]
        one = _planned(seed, "unmodelled", k, hidden=(effect,), wanted=(effect,))
        other, share = int(rng.integers(JOINTS[one.robot])), float(np.exp(rng.uniform(*np.log(SMALL_TORQUE))))
        change = partial(changes.unmodelled, joint=other, share=share, law=law)
        yield replace(one, changes=(change,))
    for k in range(SMALL["two-small"]):
        pair = PAIRS[k % 3]
        yield _planned(seed, "two-small", k, hidden=pair, wanted=pair, size=0.4)
    for k in range(SMALL["good-sensors"]):
        effect = SINGLES[k % len(SINGLES)]
        yield _planned(seed, "good-sensors", k, hidden=(effect,), wanted=(effect,), noise=0.1, size=0.2)


def filters(seed: int) -> Iterator[Planned]:
    """Low-passed logs and coarse encoders, every second one with Coulomb friction."""
    kinds = list(product((False, True), (False, True), (False, True)))  # causal, torque alone, friction
    for k in range(FILTERS):
        causal, alone, friction = kinds[k % len(kinds)]
        hertz = float(np.geomspace(*HERTZ, FILTERS)[(5 * k) % FILTERS])
        kind = f"{'causal' if causal else 'zero-phase'}-{'tau' if alone else 'all'}-{hertz:.0f}hz"
        hidden = ("coulomb_friction",) * friction
        wanted = hidden + ("torque_delay",) * (causal and alone)
        change = partial(changes.low_passed, hertz=hertz, causal=causal, torque_only=alone)
        yield _planned(seed, kind, k, hidden=hidden, wanted=wanted, changes=(change,))
    for k, (bits, friction) in enumerate(product(BITS * 2, (False, True))):
        hidden, change = ("coulomb_friction",) * friction, partial(changes.rounded, bits=bits)
        yield _planned(seed, f"{bits}bit", k, hidden=hidden, wanted=hidden, changes=(change,))


PLANS: dict[str, Callable[[int], Iterator[Planned]]] = {
    study.__name__: study for study in (clean, two_effects, torque_scale, small, filters)
}
