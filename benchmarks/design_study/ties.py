"""Ties broken by a designed motion: a poor record, the tie it ends in, the designed group, the new verdict.

A poor record holds two groups of 10 s to fit and one held out, small slow motions of the planar arm with one
payload. The hidden effect is faint: so large that a fit that knows it gains `OWN` in log likelihood at most,
and that the rival effect stays within `RIVAL` of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from benchmarks.design_study.sets import designed_groups, in_memory
from benchmarks.tables import markdown
from flexviz.analysis.designing import DesignSettings, design
from flexviz.analysis.designing.criterion import BestSeparation
from flexviz.analysis.designing.information import Columns
from flexviz.analysis.designing.subject import Planned, subject_of
from flexviz.analysis.diagnosis import Diagnosis, diagnose
from flexviz.model.effects import EFFECTS
from flexviz.model.simulation import Plan, PlannedGroup, inject, make_plan, move, random_fourier, record
from flexviz.robot.model import EffectValue

DURATION = 10.0  # [s]
SETTINGS = DesignSettings(groups=1, evaluations=144, passes=1)
NOISE = 10.0  # on both sensors, relative to the preset's
OWN, RIVAL = (60.0, 1500.0), 6.0  # gains in log likelihood
LARGER = (1.0, 1.7, 1.7, 1.7)  # factors on an effect that is not seen, one after the other
# reach [rad], harmonics, base frequency [Hz], seed of the poor motions
MOTIONS = list(product(((0.04, 0.05), (0.2, 0.25), (0.3, 0.02)), (2, 3), (0.1, 0.3), (1, 11)))
PAIRS = (
    ("coulomb_friction:joint1", "load_dependent_friction:joint1"),
    ("load_dependent_friction:joint1", "coulomb_friction:joint1"),
    ("coulomb_friction:joint2", "load_dependent_friction:joint2"),
    ("load_dependent_friction:joint2", "coulomb_friction:joint2"),
    ("cable_spring:joint1", "torque_offset:joint1"),
    ("torque_ripple:joint1", "torque_offset:joint1"),
    ("torque_ripple:joint2", "cable_spring:joint2"),
    ("cable_spring:joint2", "torque_ripple:joint2"),
    ("joint_damping:joint1", "joint_damping:joint2"),
    ("joint_damping:joint2", "joint_damping:joint1"),
    ("coulomb_friction:joint2", "link_coulomb_friction:joint2"),
    ("link_coulomb_friction:joint2", "coulomb_friction:joint2"),
    ("coulomb_friction:joint1", "link_coulomb_friction:joint1"),
    ("stiffness_hardening:joint1", "stiffness_hardening:joint2"),
    ("stiffness_hardening:joint2", "stiffness_hardening:joint1"),
    ("quadratic_friction:joint1", "stribeck_friction:joint1"),
    ("torque_gain:joint1", "stiffness_hardening:joint1"),
    ("transmission_error:joint1", "cable_spring:joint1"),
)
FRICTION = (PAIRS[2], PAIRS[3], PAIRS[10], PAIRS[11])  # that tie on several motions


@dataclass(frozen=True)
class Outcome:
    """One case.

    Attributes:
        hidden: the true effect, "cable_spring:joint2".
        size: of its first parameter.
        first: finding on the poor record, and what it is tied with.
        recorded, random, designed: expected gain of the right effect over the other one with the poor record
            alone, with a random motion within the robot's limits beside it, with the designed one.
        then: finding and ties with the designed group.
    """

    hidden: str
    size: float
    first: tuple[str, ...]
    recorded: float
    random: float
    designed: float
    then: tuple[str, ...]

    @property
    def broken(self) -> bool:
        """Whether the true effect is named with the designed group, no more tied with any earlier rival."""
        rivals = set(self.first) - {self.hidden}
        return self.then[:1] == (self.hidden,) and not rivals & set(self.then)


def poor_plan(reach: tuple[float, float], harmonics: int, hertz: float, seed: int) -> Plan:
    """The planar arm with noisy sensors on small motions about one pose."""
    plan = make_plan("planar-2r")
    motions = [
        random_fourier(
            plan.robot, seed + k, centre=[0.4, -0.6], reach=reach, duration=DURATION, harmonics=harmonics,
            frequency=2 * np.pi * hertz,
        )
        for k in range(3)
    ]  # fmt: skip
    groups = tuple(
        PlannedGroup(f"g{k}", f"t{k}", "p2", motion, DURATION, 0.001, validation=k == 3)
        for k, motion in enumerate(motions, 1)
    )
    noise = plan.sensors
    louder = replace(
        noise,
        theta_noise=NOISE * np.asarray(noise.theta_noise),
        torque_noise=NOISE * np.asarray(noise.torque_noise),
    )
    return replace(plan, groups=groups, sensors=louder)


def gains(plan: Plan, pair: tuple[str, str]) -> tuple[float, float]:
    """Gain of the first effect over no effect, and over the second one, at its typical size."""
    subject = subject_of(plan, separate=pair)
    planned = [Planned(g.name, g.payload, g.reference, DURATION) for g in plan.groups[:2]]
    measurements = subject.predicted(planned, 0.004)
    columns = Columns(measurements, subject.models, subject.noise, subject.step)
    first, second = (np.array([columns.labels.index(x) for x in one.own], int) for one in columns.contenders)
    prior, gram = columns.prior(measurements), columns.gram(measurements, measurements.groups)
    over_rival = BestSeparation(prior, (first, second)).gains(gram)[0]
    over_none = BestSeparation(prior, (np.concatenate((first, second)), second)).gains(gram)[0]
    return over_none, over_rival


def faint_plan(pair: tuple[str, str], rank: int = 0) -> Plan | None:
    """The poor plan on which the two look most alike, with the first one hidden; None if they never do.

    `rank`: 1 for the second most alike, and so on.
    """
    ranked = []
    for motion in MOTIONS:
        plan = poor_plan(*motion)
        own, rival = gains(plan, pair)
        if own > 0:
            ranked.append((max(rival, 0.0) / own, own, plan))
    share, own, plan = sorted(ranked, key=lambda entry: entry[0])[rank]
    target = min(OWN[1], RIVAL / max(share, 1e-9))
    if target < OWN[0]:
        return None
    hidden = inject(plan, [pair[0]])
    return scaled(hidden, float(np.sqrt(target / own)))  # the gain grows with the square of the size


def scaled(plan: Plan, factor: float) -> Plan:
    """The plan with the first parameter of its hidden effect multiplied."""
    (effect,) = plan.model.effects
    name, *_ = EFFECTS[effect.effect].units
    values = {**effect.parameters, name: factor * effect.parameters[name]}
    return replace(plan, model=replace(plan.model, effects=(replace(effect, parameters=values),)))


def named(found: Diagnosis) -> tuple[str, ...]:
    """The best finding, and what it is tied with; empty without one."""
    if found.verdict != "missing" or not found.findings:
        return ()
    best = found.findings[0]
    return (best.text, *(EffectValue(tie.effect, tie.joint).text for tie in best.inseparable_from))


def case(pair: tuple[str, str], rank: int = 0) -> Outcome | None:
    """The outcome of a case; None where the poor record ends in no tie that holds the true effect."""
    plan, first = faint_plan(pair, rank), ()
    if plan is None:
        return None
    for factor in LARGER:  # until the diagnosis sees the effect
        plan = scaled(plan, factor)
        runs = move(plan)
        measurements = in_memory(plan, record(plan, runs, 1))
        first = named(diagnose(measurements))
        if first:
            break
    (true,) = plan.model.effects
    if len(first) < 2 or true.text not in first:
        print(f"no tie: {true.text} {next(iter(true.parameters.values())):.3g} found as {first}", flush=True)
        return None
    other = next(text for text in first if text != true.text)
    found = design(measurements, separate=(true.text, other), settings=SETTINGS)
    added = designed_groups(found, 0.001)
    runs |= move(replace(plan, groups=added))
    longer = replace(plan, groups=(*plan.groups, *added))
    then = named(diagnose(in_memory(longer, record(longer, runs, 1))))
    size = next(iter(true.parameters.values()))
    return Outcome(true.text, size, first, min(found.recorded_gains), found.before, found.value, then)


def outcomes() -> Iterator[Outcome]:
    """Every case whose poor record ends in a tie."""
    for rank, pair in [*((0, pair) for pair in PAIRS), *product((1, 2, 3), FRICTION)]:
        outcome = case(pair, rank)
        if outcome is not None:
            yield outcome


def table(found: list[Outcome]) -> str:
    """Markdown table of the cases."""
    rows = [["hidden", "found on the poor record, and tied with it", "expected gain: recorded", "random",
             "designed", "found with the designed group"]]  # fmt: skip
    for one in found:
        numbers = [f"{x:.3g}" for x in (one.recorded, one.random, one.designed)]
        then = ", ".join(one.then) or "nothing"
        rows.append([f"{one.hidden} {one.size:.2g}", ", ".join(one.first), *numbers, then])
    return markdown(rows, numbers=False)
