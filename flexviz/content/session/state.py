"""The state of one analysis, immutable, with its history.

`Analysis` is one state: measurement set, observer and bandwidth, role of each group, effects of the model,
last identification and last diagnosis. `Session` adds undo and redo.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Literal, Unpack, get_args

import numpy as np

from flexviz import __version__
from flexviz.analysis.diagnosis import Diagnosis, PredictionErrors, prediction_errors
from flexviz.analysis.diagnosis import Step as DiagnosisStep
from flexviz.analysis.identification import FitOptions, FitSettings, Identification, fit_settings
from flexviz.base.errors import InputError, choose_from
from flexviz.base.fields import Once, SetPath
from flexviz.base.names import names_of
from flexviz.content.wording import tied_families
from flexviz.data.measurements import Drive, MeasurementSet
from flexviz.model.observers import EsoGains

Role = Literal["fit", "validate", "ignore"]
ROLES: tuple[Role, ...] = get_args(Role)
HISTORY = 100  # states that can be undone


@dataclass(frozen=True, eq=False)
class ModelStep:
    """Errors of an earlier model.

    Attributes:
        effects: added to those of the set.
        step: of its diagnosis.
        families: (effect, family) of those effects that stand for a family: which kind, the data do not tell.
    """

    effects: tuple[str, ...]
    step: Annotated[DiagnosisStep, Once()]
    families: tuple[tuple[str, str], ...] = ()


Roles = tuple[tuple[str, Role], ...]


@dataclass(frozen=True)
class Settings:
    """Everything that a result depends on.

    Attributes:
        path: folder of the measurement set.
        roles: (group, role) of every group, in the order of the set.
        fit: how it is identified, with the effects added to those of the set; its groups follow the roles.
        drive: what is stated of servos that follow goals; None: as the set states it.
    """

    path: SetPath
    roles: Roles = ()
    fit: FitSettings = field(default_factory=FitSettings)
    drive: Drive | None = None

    @property
    def effects(self) -> tuple[str, ...]:
        """Effects added to those of the set."""
        return self.fit.effects

    def alike(self, other: Settings | None) -> bool:
        """Whether both are the same; the order in which effects were added is no matter."""
        if other is None or (self.path, self.roles, self.drive) != (other.path, other.roles, other.drive):
            return False
        mine, others = sorted(self.effects), sorted(other.effects)
        return mine == others and replace(self.fit, effects=other.effects) == other.fit


@dataclass(frozen=True, eq=False)
class Analysis(Settings):
    """One state of an analysis.

    Attributes:
        path, roles, fit, drive: its settings.
        identification, fitted: the last result and the settings it belongs to.
        diagnosis, diagnosed: the last diagnosis and the settings it belongs to. The diagnosis chooses
            observer and stages itself; but what it says is not true of values found with others.
        model_steps: the models before the current one, fewest effects first.
    """

    identification: Annotated[Identification, Once()] | None = None
    fitted: Settings | None = None
    diagnosis: Annotated[Diagnosis, Once()] | None = None
    diagnosed: Settings | None = None
    model_steps: tuple[ModelStep, ...] = ()
    __eq__ = object.__eq__  # type: ignore[assignment]
    __hash__ = object.__hash__

    @property
    def used_tuning(self) -> tuple[str, float | tuple[float, ...] | None, EsoGains | None]:
        """Those of `fit`, with the bandwidth that the data chose at the last identification."""
        result = self.identification
        if result is None or self.fit.tuning != (result.observer_name, None, None):
            return self.fit.tuning
        return self.fit.observer, float(np.max(result.bandwidth)), None

    @property
    def settings(self) -> Settings:
        """Everything that its results depend on."""
        return Settings(self.path, self.roles, self.fit, self.drive)

    @property
    def up_to_date(self) -> bool:
        """Whether the last identification belongs to the current settings."""
        return self.identification is not None and self.settings.alike(self.fitted)

    @property
    def diagnosis_up_to_date(self) -> bool:
        """Whether the last diagnosis belongs to the current settings."""
        return self.diagnosis is not None and self.settings.alike(self.diagnosed)

    @property
    def current_diagnosis(self) -> Diagnosis | None:
        """The last diagnosis, if it belongs to the current settings."""
        return self.diagnosis if self.diagnosis_up_to_date else None

    def same_as(self, other: Analysis) -> bool:
        """Whether both have the same settings and results."""
        results = self.identification is other.identification and self.diagnosis is other.diagnosis
        return results and self.settings == other.settings

    def groups_with(self, role: Role) -> tuple[str, ...]:
        """Names of the groups with this role."""
        return tuple(name for name, used in self.roles if used == role)

    def with_role(self, group: str, role: Role) -> Analysis:
        """A copy with another role for one group."""
        names = [name for name, _ in self.roles]
        if group not in names:
            raise InputError(f'group "{group}" does not exist; {choose_from(group, names)}')
        if role not in ROLES:
            raise InputError(f'role "{role}" does not exist; {choose_from(role, ROLES)}')
        return replace(self, roles=tuple((name, role if name == group else old) for name, old in self.roles))

    def with_drive(self, drive: Drive) -> Analysis:
        """A copy that states something else of its servos."""
        return replace(self, drive=drive)

    def with_fit(self, **options: Unpack[FitOptions]) -> Analysis:
        """A copy with other fields of `fit`."""
        return replace(self, fit=fit_settings(self.fit, **options))

    def with_effects(self, effects: str | Iterable[str]) -> Analysis:
        """A copy with more effects."""
        new = tuple(name for name in names_of(effects) if name not in self.effects)
        return self.with_fit(effects=(*self.effects, *new))

    def without_effects(self, effects: str | Iterable[str]) -> Analysis:
        """A copy with fewer effects."""
        gone = set(names_of(effects))
        return self.with_fit(effects=[name for name in self.effects if name not in gone])

    def with_identification(self, result: Identification, settings: Settings) -> Analysis:
        """A copy with a result that was computed for `settings`."""
        return replace(self, identification=result, fitted=settings)

    def with_diagnosis(self, diagnosis: Diagnosis) -> Analysis:
        """A copy with a diagnosis of the current settings; its first model becomes the last model step.

        Earlier steps are kept if they have the same roles and a subset of the effects.
        """
        same_roles = self.diagnosed is None or self.diagnosed.roles == self.roles
        earlier = self.model_steps if same_roles else ()
        model_steps = [step for step in earlier if set(step.effects) < set(self.effects)]
        if diagnosis.steps:
            families = tied_families(self.diagnosis.findings if self.diagnosis is not None else ())
            families |= dict(pair for step in model_steps for pair in step.families)
            own = tuple((name, families[name]) for name in self.effects if name in families)
            model_steps.append(ModelStep(self.effects, diagnosis.steps[0], own))
        return replace(self, diagnosis=diagnosis, diagnosed=self.settings, model_steps=tuple(model_steps))

    def without_result(self) -> Analysis:
        """A copy without results, cheap to send to another process."""
        return replace(self, identification=None, fitted=None, diagnosis=None, diagnosed=None, model_steps=())

    @staticmethod
    def start(measurements: MeasurementSet) -> Analysis:
        """The initial state, with the split of the set into fit and validation groups."""
        roles = tuple((g.name, "validate" if g.validation else "fit") for g in measurements.groups)
        return Analysis(path=measurements.path, roles=roles)  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False)
class SessionStep:
    """An action and the state after it."""

    label: str  # of the action
    analysis: Analysis
    when: str = ""  # ISO 8601, UTC; empty if unknown
    version: str = ""  # of flexviz; empty if unknown


@dataclass(frozen=True)
class SessionNote:
    """A note of the user, with its time (ISO 8601, UTC)."""

    text: str
    when: str = ""


@dataclass(frozen=True, eq=False)
class Session:
    """An analysis with its undo history (`past`), redo history (`future`), notes and recordings."""

    present: SessionStep
    past: tuple[SessionStep, ...] = ()
    future: tuple[SessionStep, ...] = field(default=())
    notes: tuple[SessionNote, ...] = ()
    recordings: tuple[Path, ...] = ()

    @staticmethod
    def of(measurements: MeasurementSet) -> Session:
        """A new session on a set."""
        return Session(
            SessionStep(f"opened {measurements.name}", Analysis.start(measurements), now(), __version__)
        )

    @property
    def analysis(self) -> Analysis:
        """The current state."""
        return self.present.analysis

    @property
    def steps(self) -> tuple[SessionStep, ...]:
        """Past steps and the present one."""
        return (*self.past, self.present)

    @property
    def undoes(self) -> str:
        """Label of the action that `undo` reverts; empty if there is none."""
        return self.present.label if self.past else ""

    @property
    def redoes(self) -> str:
        """Label of the action that `redo` repeats; empty if there is none."""
        return self.future[0].label if self.future else ""

    def then(self, label: str, analysis: Analysis, *, merge: bool = True) -> Session:
        """The session after a change; with `merge` one with the last one's label (a slider) replaces it."""
        if analysis.same_as(self.analysis):
            return self
        merge = merge and bool(self.past) and label == self.present.label
        past = self.past if merge else (*self.past, self.present)[-HISTORY:]
        return replace(self, present=SessionStep(label, analysis, now(), __version__), past=past, future=())

    def undo(self) -> Session:
        """The session with the last change undone, if there is one."""
        if not self.past:
            return self
        return replace(self, present=self.past[-1], past=self.past[:-1], future=(self.present, *self.future))

    def redo(self) -> Session:
        """The session with the last undone change redone, if there is one."""
        if not self.future:
            return self
        return replace(self, present=self.future[0], past=(*self.past, self.present), future=self.future[1:])

    def with_note(self, text: str) -> Session:
        """A copy with one more note."""
        if not text.strip():
            raise InputError("an empty note, expected some text")
        return replace(self, notes=(*self.notes, SessionNote(text.strip(), now())))

    def with_recording(self, file: Path) -> Session:
        """A copy with one more recording."""
        others = tuple(other for other in self.recordings if other != file)
        return replace(self, recordings=(*others, file))


def now() -> str:
    """The current time, ISO 8601 in UTC."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def with_roles(measurements: MeasurementSet, roles: Mapping[str, Role]) -> MeasurementSet:
    """The set without ignored groups, the others marked for fitting or validation."""
    groups = tuple(
        replace(group, validation=roles[group.name] == "validate")
        for group in measurements.groups
        if roles.get(group.name, "ignore") != "ignore"
    )
    return replace(measurements, groups=groups)


def with_settings(measurements: MeasurementSet, settings: Settings) -> MeasurementSet:
    """The set with roles and servos of a session's settings, but without their effects."""
    chosen = with_roles(measurements, dict(settings.roles))
    return chosen if settings.drive is None else replace(chosen, drive=settings.drive)


def identified_errors(measurements: MeasurementSet, analysis: Analysis) -> PredictionErrors | None:
    """Errors of the identified model in the band that models are compared in; None without a result."""
    result, fitted = analysis.identification, analysis.fitted
    if result is None or fitted is None:
        return None
    return prediction_errors(with_settings(measurements, fitted), result.model, fitted.effects)
