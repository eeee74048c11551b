"""Models of joints that follow goals, for the search: effects of each servo, fitted by its free motion."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from dataclasses import replace

import numpy as np

from flexviz.analysis.diagnosis import LEAST_SURE, ModelScore, confidence, unexplained
from flexviz.analysis.servo.fits import REFINED, Asked, Keys, ServoFits, ServoModel
from flexviz.base.arrays import Bools
from flexviz.base.search import Gain, gain
from flexviz.model.effects import EFFECTS, ChosenEffect
from flexviz.model.servo import CASES, SERVO_EFFECTS, SHARED, of_effect, rivals_of

STEPS = 30  # of a fit from rough values, at most
TRIED = 3  # steps of every candidate, at most
AT_NOISE = 1.1  # times what counts, to which a model comes that lacks nothing
BEST = 3  # candidates of a joint that are refined


class ServoProblem(ServoFits):
    """The models of one set; the search asks for them.

    Attributes:
        name: of the resolution, as documents name it.
        banned: effects that are not tried again.
    """

    name = "coarse"

    @property
    def stages(self) -> dict[str, Callable[[ServoModel], Iterable[tuple[Hashable, ServoModel]]]]:
        """Kinds of moves."""
        return {"add": self.larger, "swap": self.exchanged}

    def parts(self, model: ServoModel) -> frozenset[Hashable]:
        """What a model has more than the set's own one."""
        return frozenset(model.keys - self.given)

    def begin(self) -> ServoModel:
        """The set's own model, and the criterion of this recording."""
        owners = sorted(set(self.data.owner.tolist()))
        bare: Keys = frozenset()
        (fit,) = self.fitted([(o, bare, self.rough) for o in owners], STEPS)
        self.refresh(fit.values)
        (fit,) = self.fitted([(o, bare, fit.values) for o in owners], REFINED)
        self.renew(fit)
        model = self.model(bare)
        for effect in dict.fromkeys(key.effect for key in sorted(self.given, key=_order)):
            more = frozenset(key for key in self.given if key.effect == effect)
            having = [o for o in owners if self.own(more, o)]
            asked = [(o, self.own(model.keys | more, o), model.states[o].values) for o in having]
            self.fitted(self.placed(model, asked), REFINED)
            model = self.model(model.keys | more)
        values = model.values(self.data.owner)
        (fit,) = self.fitted([(o, self.own(self.given, o), values) for o in owners], REFINED)
        self.renew(fit)
        self.known.clear()
        self.fitted([(o, self.own(self.given, o), fit.values) for o in owners], TRIED)
        return self.model(self.given)

    def candidates(self, own: Keys, owner: int) -> list[ChosenEffect]:
        """Effects that a servo may have besides its `own`."""
        joints = np.flatnonzero(self.data.owner == owner)
        out = []
        names = {k.effect for k in own}
        for effect in SERVO_EFFECTS:
            if effect in names or any(EFFECTS[name].replaces == effect for name in names):
                continue
            shared = SHARED[of_effect(effect)[0]]
            out += [ChosenEffect(effect, int(j)) for j in (joints[:1] if shared else joints)]
        return [key for key in out if key not in self.banned]

    def larger(self, model: ServoModel) -> list[tuple[Hashable, ServoModel]]:
        """Models with one effect more, and the servo to which it belongs."""
        asked: list[Asked] = []
        for owner, state in model.states.items():
            own = self.own(model.keys, owner)
            for key in self.candidates(own, owner):
                left = frozenset(k for k in own if EFFECTS[key.effect].replaces != k.effect)
                asked.append((owner, with_base(left, key), state.values))
        return self.tried(model, asked)

    def exchanged(self, model: ServoModel) -> list[tuple[Hashable, ServoModel]]:
        """Models with an effect in place of one for which it may be taken."""
        asked: list[Asked] = []
        for owner in model.states:
            own = self.own(model.keys, owner)
            needed = {EFFECTS[k.effect].beside for k in own}
            for key in (k for k in own - self.given if k.effect not in needed):
                rivals = self.rivals(model, owner, key)
                asked += [self.in_place(model, owner, key, other) for other in rivals]
        return self.tried(model, asked)

    def rivals(self, model: ServoModel, owner: int, key: ChosenEffect) -> list[ChosenEffect]:
        """Effects for which one of a servo may be taken."""
        others = self.candidates(self.own(model.keys, owner) - {key}, owner)
        return [one for one in others if one != key and one.effect in rivals_of(key.effect)]

    def in_place(self, model: ServoModel, owner: int, key: ChosenEffect, other: ChosenEffect) -> Asked:
        """A servo with one effect in place of another; a case of it is fitted from the same motion."""
        keys, values = with_base(self.own(model.keys, owner) - {key}, other), model.states[owner].values
        if alike := CASES.get((key.effect, other.effect)):
            values = alike(values)
            self.fitted([(owner, keys, values)], REFINED)
        return owner, keys, values

    def tried(self, model: ServoModel, asked: list[Asked]) -> list[tuple[Hashable, ServoModel]]:
        """Models of which one servo has other effects, fitted: the best few of each servo."""
        fresh = [one for one in asked if one[:2] not in self.known]
        if fresh:
            self.fitted(self.placed(model, fresh), TRIED, thin=True)
        best: list[Asked] = []
        for owner in model.states:
            mine = [(o, k) for o, k, _ in asked if o == owner]
            mine.sort(key=lambda one: self.nats(self.known[one])[self.data.owner == owner].sum())
            best += [(o, k, self.known[o, k].values) for o, k in mine[:BEST]]
        self.fitted([one for one in best if one[:2] not in self.refined], REFINED)
        self.refined |= {one[:2] for one in best}
        others = model.keys
        out = []
        for owner, keys, _ in best:
            rest = frozenset(k for k in others if int(self.data.owner[k.joint]) != owner)
            found = self.model(rest | keys)
            sure = self.certainty(found, gain(self.score(model), self.score(found)))
            # what takes another's place is judged at the end, by what it gains against nothing
            if len(found.keys) <= len(model.keys) or sure >= LEAST_SURE:
                out.append((owner, found))
        return out

    def united(self, model: ServoModel, others: list[ServoModel]) -> ServoModel:
        """Each servo with what the best of the others has there."""
        keys = model.keys
        for owner in model.states:
            mine = [o for o in others if self.own(o.keys, owner) != self.own(model.keys, owner)]
            if mine:
                best = min(mine, key=lambda m: self.score(m).total)
                rest = frozenset(k for k in keys if int(self.data.owner[k.joint]) != owner)
                keys = rest | self.own(best.keys, owner)
        return self.model(keys)

    def smaller(self, model: ServoModel) -> Iterable[ServoModel]:
        """Models without one effect, the least needed first."""
        asked, out = [], []
        for key in model.keys - self.given:
            owner = int(self.data.owner[key.joint])
            keys = self.own(model.keys, owner) - {key}
            needed = {EFFECTS[k.effect].beside for k in keys}
            if key.effect in needed:
                continue
            values = model.states[owner].values
            asked.append((owner, keys, values))
            out.append(model.keys - {key})
        fresh = [one for one in asked if one[:2] not in self.known]
        if fresh:
            self.fitted(fresh, REFINED)
        return sorted(map(self.model, out), key=lambda m: self.score(m).total)

    def certainty(self, model: ServoModel, need: Gain) -> float:
        """Probability that an effect of a model is right, against "none of these", by what it gains."""
        joint = int(np.argmax(need.by_joint / self.samples))
        left = unexplained(need, self.samples, joint) if self.errs(model)[joint] else 0.0
        return confidence(need.delta, left)

    def errs(self, model: ServoModel) -> Bools:
        """(n,) whether a joint's error is more than noise and tolerance."""
        return self.score(model).deviation > AT_NOISE * self.least

    def score(self, model: ServoModel) -> ModelScore:
        """What the criterion says of a model."""
        owner = self.data.owner
        sigma = np.array([model.states[int(o)].deviation[j] for j, o in enumerate(owner)])
        held = np.array([model.states[int(o)].held_out[j] for j, o in enumerate(owner)])
        parameters = sum(len(of_effect(k.effect)) for k in model.keys - self.given)
        cost = self.criterion.cost(parameters, len(model.keys - self.given))
        return ModelScore(self.criterion.nats(sigma), self.criterion.nats(held), cost, sigma, held)


def with_base(own: Keys, key: ChosenEffect) -> Keys:
    """A servo's effects with one more, and with that beside which it stands."""
    base = EFFECTS[key.effect].beside
    missing = base is not None and all(k.effect != base for k in own)
    return own | {key} | ({replace(key, effect=base)} if missing else set())


def _order(key: ChosenEffect) -> int:
    return SERVO_EFFECTS.index(key.effect)
