"""One computation on a set whose joints follow goals."""

from __future__ import annotations

import time
from dataclasses import replace

from flexviz.analysis.estimation import Stopped
from flexviz.analysis.identification import FitSettings
from flexviz.analysis.servo.conclusion import tied
from flexviz.analysis.servo.estimate import ServoEstimate
from flexviz.analysis.servo.fit import FINE, fit_servos
from flexviz.analysis.servo.fits import REFINED, Keys, ServoModel, owners
from flexviz.analysis.servo.judge import TrajectoryJudge
from flexviz.analysis.servo.problem import ServoProblem
from flexviz.base.arrays import Array
from flexviz.base.errors import InputError
from flexviz.base.facts import Fact
from flexviz.base.progress import Progress, ProgressCallback, StopCallback, ignore, never
from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import choose_effects
from flexviz.model.servo import SERVO_EFFECTS, SHARED, of_effect

LOADED = ("load_dependent_friction", "driving_friction")  # which differ by a scale of the torque, if at all


class ServoCourse:
    """One computation on a set."""

    def __init__(
        self,
        measurements: MeasurementSet,
        progress: ProgressCallback | None,
        should_stop: StopCallback | None,
    ) -> None:
        self.measurements, self.began = measurements, time.perf_counter()
        self.progress, self.should_stop = progress or ignore, should_stop or never
        self.stopped, self.searching = False, True
        self.news = Progress()
        self.given = given_effects(measurements)
        self.say(Fact("servo-stage", values={"stage": "masses"}))
        self.problem = ServoProblem(measurements, self.check, self.given)
        self.judge = TrajectoryJudge(measurements)

    def say(self, fact: Fact) -> None:
        """Report what is being done."""
        self.news = replace(self.news, text=fact.text)
        self.progress(self.news)

    def check(self) -> None:
        """Raise if the user has stopped it."""
        if self.searching and self.should_stop():
            self.stopped = True
            raise Stopped
        self.progress(self.news)

    def finished(self, model: ServoModel, steps: int = REFINED, given: Array | None = None) -> ServoEstimate:
        """A model, fitted until nothing changes; or with `given` values (P, n)."""
        problem = self.problem
        values = model.values(problem.data.owner) if given is None else given
        free = problem.free(model.keys)
        (fit,) = fit_servos(
            problem.data, [(free, values)], steps if given is None else 0, problem.samples, turn=FINE
        )
        every = [one for key in model.keys for one in problem.of_joints(key)]
        order = sorted(every, key=lambda k: (k.joint, SERVO_EFFECTS.index(k.effect)))
        sure = problem.scale_determined(free, fit.values)
        for key in model.keys:
            if key.effect in LOADED and any(tie.effect in LOADED for tie in tied(problem, model, key)):
                sure[problem.data.owner == problem.data.owner[key.joint]] = False
        return ServoEstimate(
            self.measurements, problem.data, problem.samples, free, fit.values, tuple(order), sure
        )


def given_effects(measurements: MeasurementSet) -> Keys:
    """The effects of the set's own model, one for joints that have the same servo.

    Raises:
        InputError: an effect that a joint with goals cannot have.
    """
    chosen = choose_effects(measurements.effects, measurements.joints)
    for one in chosen:
        if one.effect not in SERVO_EFFECTS:
            known = ", ".join(SERVO_EFFECTS)
            text = one.text(measurements.joints)
            raise InputError(
                f'effect "{text}" is not known of joints that follow goals; expected one of {known}'
            )
    owner = owners(measurements)
    return frozenset(
        replace(one, joint=int(owner[one.joint])) if shared(one.effect) else one for one in chosen
    )


def shared(effect: str) -> bool:
    """Whether joints with the same servo have it alike."""
    return bool(SHARED[of_effect(effect)[0]])


def with_settings(measurements: MeasurementSet, settings: FitSettings) -> MeasurementSet:
    """The set with the groups and effects of settings."""
    if settings.groups is not None:
        fitted, held_out = measurements.select(settings.groups)
        chosen = tuple(group for group in measurements.groups if group in (*fitted, *held_out))
        measurements = replace(measurements, groups=chosen)
    return replace(measurements, effects=(*measurements.effects, *settings.effects))
