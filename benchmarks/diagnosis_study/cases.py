"""The cases of the study: what is hidden, in which robot, at which noise."""

from __future__ import annotations

import zlib
from collections import Counter
from dataclasses import dataclass

import numpy as np

from benchmarks.diagnosis_study.laws import EXTRA_LAWS
from benchmarks.diagnosis_study.robots import ROBOTS
from benchmarks.diagnosis_study.sizes import SIZES
from flexviz.model.effects import EFFECTS

NOISES = (0.5, 1.0, 3.0)
NUMBERS: dict[tuple[str, str], int] = {  # (kind, robot): how many
    ("single", "2r"): 260,
    ("single", "panda"): 30,
    ("single", "ur5"): 30,
    ("limit", "2r"): 60,
    ("limit", "panda"): 10,
    ("limit", "ur5"): 10,
    ("pair", "2r"): 36,
    ("pair", "panda"): 6,
    ("pair", "ur5"): 6,
    ("clean", "2r"): 114,
    ("clean", "panda"): 20,
    ("clean", "ur5"): 20,
    ("unknown", "2r"): 56,
    ("unknown", "panda"): 8,
    ("unknown", "ur5"): 8,
}
KINDS = tuple(dict.fromkeys(kind for kind, _ in NUMBERS))
CLEAN_BASES = (
    (), ("coulomb_friction",), (), ("coulomb_friction", "torque_offset"), (), ("coulomb_friction",),
    (), ("coulomb_friction", "quadratic_friction"), (), ("link_coulomb_friction",),
)  # fmt: skip
USUAL = "coulomb_friction"  # what a set's model most often has from the start
OFTEN_BESIDE_USUAL = {"load_dependent_friction", "presliding_hysteresis"}
NEVER_BESIDE_USUAL = {USUAL, *EFFECTS[USUAL].twins}
# pairs that data of this kind cannot tell apart: naming the twin counts, where it is reported as tied
TWINS = {frozenset((name, twin)) for name, effect in EFFECTS.items() for twin in effect.twins}


@dataclass(frozen=True)
class Case:
    """One simulated set.

    Attributes:
        kind: "single", "limit" (size around the detection limit), "pair", "clean" or "unknown".
        effects: the library's effects that are hidden.
        extra_law: the hidden law that the library does not have; "" for none.
        base: effects that the set's model knows of.
        noise: scale of the sensors' noise.
        seed: of the study.
    """

    name: str
    kind: str
    robot: str
    effects: tuple[str, ...]
    extra_law: str
    base: tuple[str, ...]
    noise: float
    seed: int

    def rng(self, purpose: str) -> np.random.Generator:
        """Random numbers of this case alone: other cases may come and go."""
        return generator(self.seed, f"{self.name} {purpose}")


def generator(seed: int, text: str) -> np.random.Generator:
    """Random numbers that belong to a text."""
    return np.random.default_rng([seed, zlib.crc32(text.encode())])


def cases(seed: int = 1, numbers: dict[tuple[str, str], int] | None = None) -> list[Case]:
    """All cases of a study, the kinds mixed; the first ones of each are the same whatever their number."""
    wanted = NUMBERS if numbers is None else numbers
    order = [((k + 0.5) / count, where, k) for where, count in wanted.items() for k in range(count)]
    order.sort(key=lambda row: row[0])
    return [_case(*where, k, seed) for _, where, k in order]


def selected(seed: int, only: str = "", of_each: int | None = None) -> list[Case]:
    """The study's cases with `only` in their names, at most `of_each` of every kind and robot."""
    seen: Counter[tuple[str, str]] = Counter()
    out = []
    for case in cases(seed):
        if only not in case.name:
            continue
        seen[case.kind, case.robot] += 1
        if of_each is None or seen[case.kind, case.robot] <= of_each:
            out.append(case)
    return out


def _case(kind: str, robot: str, k: int, seed: int) -> Case:
    assert robot in ROBOTS
    rng = generator(seed, f"{kind} {robot} {k}")
    effects: tuple[str, ...] = ()
    extra_law, base = "", ()
    names = list(SIZES)
    shift = 0 if robot != "ur5" else len(names) // 2  # so that few cases on two arms show every effect
    noise = NOISES[k % len(NOISES)]  # every effect meets each of them
    if kind in ("single", "limit"):
        effects = (names[(k + shift) % len(names)],)
        base = _base(effects, rng)
    elif kind == "pair":
        effects, base = _pair(names, rng)
    elif kind == "clean":
        base = CLEAN_BASES[k % len(CLEAN_BASES)]
    else:
        extra_law = list(EXTRA_LAWS)[(k + shift) % len(EXTRA_LAWS)]
        base = (USUAL,) if rng.random() < 0.3 else ()
    label = "+".join(effects) or extra_law or "+".join(base) or "plain"
    return Case(f"{kind}-{robot}-{k:03d}-{label}", kind, robot, effects, extra_law, base, noise, seed)


def _base(effects: tuple[str, ...], rng: np.random.Generator) -> tuple[str, ...]:
    if set(effects) & NEVER_BESIDE_USUAL:
        return ()
    needed = any(EFFECTS[name].beside == USUAL for name in effects)
    share = 1.0 if needed else 0.6 if set(effects) & OFTEN_BESIDE_USUAL else 0.2
    return (USUAL,) if rng.random() < share else ()


def _pair(names: list[str], rng: np.random.Generator) -> tuple[tuple[str, ...], tuple[str, ...]]:
    while True:
        first, second = (str(name) for name in rng.choice(names, 2, replace=False))
        if frozenset((first, second)) in TWINS or _clash(first, second) or _clash(second, first):
            continue
        needed = EFFECTS[first].beside == second or EFFECTS[second].beside == first
        return (first, second), () if needed else _base((first, second), rng)


def _clash(one: str, other: str) -> bool:
    """Whether one replaces the other or what that needs, or is a twin of what it needs or replaces."""
    refined = {EFFECTS[other].beside, EFFECTS[other].replaces} - {None}
    return EFFECTS[one].replaces in {other, EFFECTS[other].beside} - {None} or bool(
        refined & set(EFFECTS[one].twins)
    )
