"""The search forwards: effects are scored, refitted and added one by one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import takewhile

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis import stages
from flexviz.diagnosis.acceptance import Gained, excess, exhausted, largest_excess, removed_share, verdict
from flexviz.diagnosis.candidates import ModelStart, NearNoise
from flexviz.diagnosis.comparison import RefittedCandidate, SearchStep
from flexviz.diagnosis.constancy import changing_size, explained_by_drift, removed
from flexviz.diagnosis.effect_at_place import effects_at_place
from flexviz.diagnosis.evidence import uncertain
from flexviz.diagnosis.exchange import exchanged
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.model_error import ModelErrorSearch, imitates
from flexviz.diagnosis.search import Search
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.diagnosis.unknown_place import UnknownPlace, unknown_place

Array = NDArray[np.float64]

LIMITS, ACCEPTANCE = THRESHOLDS.search, THRESHOLDS.acceptance


class ForwardSearch:
    """Effects added to the set's own model.

    Args:
        context: the data.
        base: fit of the set's own model.
        say: called with a progress message; may raise to stop.
        fitted: called with the fit of each model that is accepted.
        foresee: called with a model that may be the last one.
        apply: add effects one by one; otherwise only the first one is found.

    Attributes:
        reference: the same parameters as of `base` without any effects.
        steps: effects added so far.
        tried: candidates refitted for the base model.
        model_error_variance: shape (n,) [Nm²], allowed in the later steps; None if there is none.
        place: of a law of no library; None if there is none or it is not found.
        seen_base, seen_place: a fit of the set's own model, and the place of what it lacks, if looked for.
        searched_place: the place at which effects were tried last.
    """

    def __init__(
        self,
        context: FitContext,
        base: Fit,
        say: Callable[[str], None],
        fitted: Callable[[Fit], None],
        foresee: Callable[[ModelStart], None],
        apply: bool = True,
    ) -> None:
        self.context, self.base, self.say, self.fitted, self.foresee = context, base, say, fitted, foresee
        self.apply = apply
        self.search = Search(context, say)
        self.reference = context.without_effects(base)
        self.steps: list[SearchStep] = []
        self.tried: list[RefittedCandidate] = []
        self.model_error_variance: Array | None = None
        self.place: UnknownPlace | None = None
        self.seen_base: Fit | None = None
        self.seen_place: UnknownPlace | None = None
        self.searched_place: UnknownPlace | None = None

    @property
    def final(self) -> Fit:
        """The last model so far."""
        return self.steps[-1].after if self.steps else self.base

    @property
    def unexplained(self) -> bool:
        """Whether the final model leaves more than noise and the drift of the size of a main effect."""
        final = self.final
        if verdict(final, self.reference) != "unknown":
            return False
        return any(map(self._doubtful, self.steps)) or not explained_by_drift(self.context, final)

    def _doubtful(self, step: SearchStep) -> bool:
        """Whether an effect is uncertain and does not explain most of what its step was to explain."""
        removed = removed_share(step.before, step.chosen.fit)
        return removed < ACCEPTANCE.changing_main and uncertain(self.context, step, self.final)

    @property
    def complete(self) -> bool:
        """Whether the final model leaves only noise, and all its sizes are constant."""
        final = self.final
        return verdict(final, self.reference) != "unknown" and changing_size(self.context, final) is None

    def add_effects(self, near: NearNoise | None = None, most: int = LIMITS.rounds) -> None:
        """Add up to `most` effects, until none is acceptable; `near`: a model that may explain all."""
        for number in range(LIMITS.rounds):
            self.form_products()
            fit = self.final
            self.say("scoring candidate effects")
            if (self.apply or not self.steps) and verdict(fit, self.reference) == "nothing-missing":
                self.foresee(ModelStart(fit.layout, fit.x))
            gained = Gained.by_effects(fit, self.reference)
            if self.steps and exhausted(fit, gained):
                break
            scores, compared = self.search.compare(fit, gained, near if number == 0 else None)
            if not self.steps:
                lower = (r for r in compared.refitted if r.fit.objective < fit.objective)
                self.tried = [r.reported(self.context.covariance(r.fit)) for r in lower]
            best = self.search.acceptable(fit, compared.refitted, gained)
            if best is None or changing_size(self.context, fit, removed(fit, best)):
                break
            if (again := self.search.restarted(fit, best, gained)) is not None:
                self.replace_final(again)
                continue
            self.steps.append(SearchStep(fit, best, compared.objectives, scores.shortened()))
            self.fitted(best.fit)
            del fit, best, compared, scores  # the next round needs as much memory
            if not self.apply:
                break
            self.drop_superfluous()
            self.exchange()
            if len(self.steps) >= most:
                break

    def form_products(self) -> None:
        """From now on form products of signals before they are filtered, if that explains what is left.

        Elsewhere, the simpler equation has less noise.
        """
        fit, least = self.final, LIMITS.products_excess
        if self.context.two_band.has_products or not fit.layout.has_reversals:
            return
        if largest_excess(fit) < least or excess(fit) > LIMITS.products_most:
            return
        context = self.context.with_products()
        if not context.two_band.has_products:
            return
        better = context.fit(
            fit.layout, fit.x, iterations=LIMITS.short_refit, check=self.search.check, near=fit
        )
        if better.objective > fit.objective - ACCEPTANCE.least_gain:
            return
        self.context = context
        self.search.go_on_with(context)
        if self.steps:
            self.reference = context.without_effects(self.base)
        self.replace_final(better)

    def look_at_place_first(self) -> bool:
        """Whether an arbitrary torque at one place explains all that the set's own model lacks.

        The effect that acts there is added, if there is one. Far from the noise, trying all candidates would
        take most of the time, and what they explain elsewhere would be withdrawn.
        """
        if excess(self.base) < LIMITS.far_off:
            return False
        place = self.place_of_base()
        if place is None or not place.complete:
            return False
        self.try_effects_at(place)
        return True

    def replace_final(self, fit: Fit) -> None:
        """Replace the fit of the final model by a better one from other start values."""
        if self.steps:
            last = self.steps[-1]
            self.steps[-1] = replace(last, chosen=replace(last.chosen, fit=fit))
        else:
            self.base, self.reference = fit, self.context.without_effects(fit)

    def drop_superfluous(self) -> None:
        """Drop earlier effects that the newest one made superfluous, and refit the steps without them."""
        earlier = tuple(step.chosen.effect for step in self.steps[:-1])
        simpler = self.search.without_superfluous(self.final, earlier)
        dropped = set(self.final.layout.effects) - set(simpler.layout.effects)
        if not dropped:
            return
        self.rest_on([step for step in self.steps if step.chosen.effect not in dropped], simpler)

    def exchange(self) -> None:
        """Exchange earlier effects for rivals of theirs that fit better beside the newest effect."""
        for k, step in enumerate(self.steps[:-1]):
            better = exchanged(self.search, self.final, step)
            if better is None:
                continue
            others = step.refitted(step.before, self.final).objectives
            objectives = {**others, better.effect: better.fit.objective}
            changed = replace(step, chosen=better, objectives=objectives)
            self.rest_on([*self.steps[:k], changed, *self.steps[k + 1 :]], better.fit)
            self.fitted(self.final)

    def rest_on(self, steps: list[SearchStep], final: Fit) -> None:
        """Refit the given steps one after another up to the last one, which ends with the model `final`."""
        *earlier, last = steps
        before, out = self.steps[0].before, []
        for step in earlier:
            after = self.search.refit(before, step.chosen.scored, LIMITS.first_iterations).fit
            out.append(step.refitted(before, after))
            before = after
        self.steps = [*out, last.refitted(before, final)]

    def explain_the_rest(self) -> None:
        """Find the place of a law of no library; else add effects that held-out groups confirm.

        Imitations are withdrawn. A model error is allowed for then.
        """
        limits = THRESHOLDS.model_error
        self.steps = list(takewhile(lambda s: not imitates(self.search, s, self.final), self.steps))
        self.find_place()
        place = self.place
        done = (place is not None and place.complete) or (self.steps and not self.apply)
        if done or excess(self.final) < limits.needed_excess:
            return
        search = ModelErrorSearch(self.search, limits.effects if self.apply else 1)
        steps = search.run(self.final)
        if not steps or (place is not None and self._left(steps[-1].after) > place.left):
            return  # the effects imitate what acts at the place
        self.steps += steps
        self.model_error_variance, self.place = search.variance, None

    def _left(self, fit: Fit) -> float:
        """Excess of a model in units of the noise alone."""
        try:
            return excess(self.context.fit(fit.layout, fit.x, iterations=0))
        except np.linalg.LinAlgError:
            return np.inf

    def find_place(self) -> None:
        """Find the place of a law of no library."""
        self.settle(self.place_of_base())

    def place_of_base(self) -> UnknownPlace | None:
        """The place of what the set's own model lacks."""
        if self.seen_base is not self.base:
            self.say(stages.PLACE)
            self.seen_place = unknown_place(self.context, self.base, self.search.check)
            self.seen_base = self.base
        return self.seen_place

    def settle(self, place: UnknownPlace | None) -> None:
        """Withdraw effects elsewhere than at the place of what the set's own model lacks: they imitate it."""
        if place is not None and place.complete:
            joint = place.unknown.joint
            self.steps = list(takewhile(lambda s: s.chosen.effect.joint == joint, self.steps))
        if self.steps:  # what is missing beside them may act elsewhere
            place = unknown_place(self.context, self.final, self.search.check) if self.apply else None
        elif place is not None and not self.base.converged:
            self.replace_final(self.search.continued(self.base, LIMITS.last_refit))
        self.place = place
        if place is not None and (self.apply or not self.steps):
            self.try_effects_at(place)

    def try_effects_at(self, place: UnknownPlace) -> None:
        """Add an effect of the library that acts at a place, and others beside it, if they explain all.

        Or all but a drift of its size, or clearly more than an arbitrary torque at the place, which no
        imitation does.
        """
        if self.searched_place is place:
            return
        self.searched_place, before = place, self.steps
        steps = effects_at_place(self.search, self.final, place)
        if not steps or (len(steps) > 1 and not self.apply):
            return
        self.steps = [*before, *steps]
        explained = explained_by_drift(self.context, self.final)
        try:
            if self.apply and not explained:
                self.add_effects()
            left = THRESHOLDS.unknown_place.beyond * place.left
            explained = explained or self.complete or (self.apply and excess(self.final) < left)
        finally:  # also if the user stops it
            if not explained:
                self.steps = before
        if explained:
            self.fitted(self.final)
            self.place = None
