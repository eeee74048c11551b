"""The state of one analysis, immutable, with its history.

`Analysis` is one state: which set, which observer and bandwidth, what each group is used for, which effects
are in the model, the last identification and the last diagnosis. `Session` holds the states one can go back
and forward to.
Nothing here computes or draws; the app, a recording and a report all show the same state.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, get_args

from flexviz import __version__
from flexviz.errors import InputError, choose_from

if TYPE_CHECKING:
    from flexviz.diagnosis import Diagnosis
    from flexviz.diagnosis import Step as DiagnosisStep
    from flexviz.identification import Identification
    from flexviz.measurements import MeasurementSet

Role = Literal["fit", "validate", "ignore"]
ROLES: tuple[Role, ...] = get_args(Role)
HISTORY = 100  # states one can go back


@dataclass(frozen=True, eq=False)
class ModelStep:
    """The errors of one model on the way: the effects added to the set's own, and what a diagnosis says."""

    effects: tuple[str, ...]
    step: DiagnosisStep


class Settings(NamedTuple):
    """Everything an identification depends on; the fields are those of `Analysis`."""

    path: Path
    observer: str
    bandwidth: float | tuple[float, ...] | None
    roles: tuple[tuple[str, Role], ...]
    effects: tuple[str, ...]
    refine: bool


@dataclass(frozen=True, eq=False)
class Analysis:
    """One state of an analysis.

    Attributes
    ----------
    path: the measurement set's folder.
    observer: name of the observer.
    bandwidth: its bandwidth [rad/s], one number or one a joint; None is the observer's own default.
    roles: (group, role) of every group, in the set's order.
    effects: effects added to the set's own, "name" (every joint), "name:joint", "name:payload" or
        "name:joint@group".
    refine: whether the refinement stage runs too.
    identification: the last result, or None.
    fitted: the settings (`settings`) the result belongs to, or None.
    diagnosis: the last diagnosis, or None.
    diagnosed: the settings (`diagnosis_settings`) it belongs to, or None.
    model_steps: the models on the way to the present one, the fewest effects first.
    """

    path: Path
    observer: str = "butterworth-zero-phase"
    bandwidth: float | tuple[float, ...] | None = None
    roles: tuple[tuple[str, Role], ...] = ()
    effects: tuple[str, ...] = ()
    refine: bool = False
    identification: Identification | None = None
    fitted: tuple[Any, ...] | None = None
    diagnosis: Diagnosis | None = None
    diagnosed: tuple[Any, ...] | None = None
    model_steps: tuple[ModelStep, ...] = ()

    @property
    def settings(self) -> Settings:
        """Everything a result depends on."""
        return Settings(self.path, self.observer, self.bandwidth, self.roles, self.effects, self.refine)

    @property
    def fitted_settings(self) -> Settings | None:
        """The settings that the last result belongs to."""
        return None if self.fitted is None else Settings(*self.fitted)

    @property
    def up_to_date(self) -> bool:
        """True when the last result belongs to the present settings."""
        return self.identification is not None and self.fitted == self.settings

    @property
    def diagnosis_settings(self) -> tuple[Any, ...]:
        """Everything a diagnosis depends on: it chooses its observer and its stages itself."""
        return (self.path, self.roles, self.effects)

    @property
    def diagnosis_up_to_date(self) -> bool:
        """True when the last diagnosis belongs to the present settings."""
        return self.diagnosis is not None and self.diagnosed == self.diagnosis_settings

    def same_as(self, other: Analysis) -> bool:
        """True when nothing distinguishes the two: same settings, the same results."""
        results = self.identification is other.identification and self.diagnosis is other.diagnosis
        return results and self.settings == other.settings

    def groups_with(self, role: Role) -> tuple[str, ...]:
        """Names of the groups with this role."""
        return tuple(name for name, used in self.roles if used == role)

    def with_role(self, group: str, role: Role) -> Analysis:
        """The same with another role for one group."""
        names = [name for name, _ in self.roles]
        if group not in names:
            raise InputError(f'group "{group}" does not exist; {choose_from(group, names)}')
        if role not in ROLES:
            raise InputError(f'role "{role}" does not exist; {choose_from(role, ROLES)}')
        return replace(self, roles=tuple((name, role if name == group else old) for name, old in self.roles))

    def with_effect(self, effect: str, on: bool) -> Analysis:
        """The same with an effect added or taken out; the order of the others stays."""
        others = tuple(name for name in self.effects if name != effect)
        return replace(self, effects=(*others, effect) if on else others)

    def with_identification(self, result: Identification, settings: tuple[Any, ...]) -> Analysis:
        """The same with a result that was computed for `settings`."""
        return replace(self, identification=result, fitted=settings)

    def with_diagnosis(self, diagnosis: Diagnosis) -> Analysis:
        """The same with a diagnosis of the present settings; its first model is a stair.

        Of the model_steps before it those stay that lead here: the same use of the groups, fewer effects.
        """
        model_steps = list(
            self.model_steps if self.diagnosed is None or self.diagnosed[1] == self.roles else ()
        )
        model_steps = [stair for stair in model_steps if set(stair.effects) < set(self.effects)]
        if diagnosis.steps:
            model_steps.append(ModelStep(self.effects, diagnosis.steps[0]))
        return replace(
            self, diagnosis=diagnosis, diagnosed=self.diagnosis_settings, model_steps=tuple(model_steps)
        )

    def without_result(self) -> Analysis:
        """The settings alone, light enough to be sent to another process."""
        return replace(self, identification=None, fitted=None, diagnosis=None, diagnosed=None, model_steps=())

    @staticmethod
    def start(measurements: MeasurementSet) -> Analysis:
        """The state a set starts with: its own split into fit and validation groups."""
        roles = tuple((g.name, "validate" if g.validation else "fit") for g in measurements.groups)
        return Analysis(path=measurements.path, roles=roles)  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False)
class SessionStep:
    """A state and what led to it.

    Attributes
    ----------
    label: what was done.
    analysis: the state after it.
    when: the time, ISO 8601 in UTC; empty where it is not known.
    version: of flexviz; empty where it is not known.
    """

    label: str
    analysis: Analysis
    when: str = ""
    version: str = ""


@dataclass(frozen=True)
class SessionNote:
    """What a person wrote down, and when (ISO 8601 in UTC)."""

    text: str
    when: str = ""


@dataclass(frozen=True, eq=False)
class Session:
    """An analysis with the states before it and, after an undo, the ones that come again.

    Attributes
    ----------
    present, past, future: the states.
    notes: what was written down about it.
    recordings: files that were recorded from it.
    """

    present: SessionStep
    past: tuple[SessionStep, ...] = ()
    future: tuple[SessionStep, ...] = field(default=())
    notes: tuple[SessionNote, ...] = ()
    recordings: tuple[Path, ...] = ()

    @staticmethod
    def of(measurements: MeasurementSet) -> Session:
        """A fresh session on a set."""
        return Session(
            SessionStep(f"opened {measurements.name}", Analysis.start(measurements), now(), __version__)
        )

    @property
    def analysis(self) -> Analysis:
        """The present state."""
        return self.present.analysis

    @property
    def steps(self) -> tuple[SessionStep, ...]:
        """Past and present, in that order."""
        return (*self.past, self.present)

    @property
    def undoes(self) -> str:
        """What `undo` takes back; empty where it does nothing."""
        return self.present.label if self.past else ""

    @property
    def redoes(self) -> str:
        """What `redo` brings again; empty where it does nothing."""
        return self.future[0].label if self.future else ""

    def then(self, label: str, analysis: Analysis) -> Session:
        """The session after a change; changes with the same label in a row (a slider) count as one."""
        if analysis.same_as(self.analysis):
            return self
        merge = bool(self.past) and label == self.present.label
        past = self.past if merge else (*self.past, self.present)[-HISTORY:]
        return replace(self, present=SessionStep(label, analysis, now(), __version__), past=past, future=())

    def undo(self) -> Session:
        """One change back (the same session when there is none)."""
        if not self.past:
            return self
        return replace(self, present=self.past[-1], past=self.past[:-1], future=(self.present, *self.future))

    def redo(self) -> Session:
        """One undone change forward (the same session when there is none)."""
        if not self.future:
            return self
        return replace(self, present=self.future[0], past=(*self.past, self.present), future=self.future[1:])

    def with_note(self, text: str) -> Session:
        """The same with something written down."""
        if not text.strip():
            raise InputError("an empty note; a word or more would be right")
        return replace(self, notes=(*self.notes, SessionNote(text.strip(), now())))

    def with_recording(self, file: Path) -> Session:
        """The same with a recording that belongs to it."""
        others = tuple(other for other in self.recordings if other != file)
        return replace(self, recordings=(*others, file))


def now() -> str:
    """The present time, ISO 8601 in UTC."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def with_roles(measurements: MeasurementSet, roles: Mapping[str, Role]) -> MeasurementSet:
    """The set as the roles say: ignored groups left out, the others marked for fitting or validation."""
    groups = tuple(
        replace(group, validation=roles[group.name] == "validate")
        for group in measurements.groups
        if roles.get(group.name, "ignore") != "ignore"
    )
    return replace(measurements, groups=groups)
