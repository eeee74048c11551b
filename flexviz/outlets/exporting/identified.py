"""The robot to be exported with its identified model, and warnings about both."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flexviz import __version__
from flexviz.analysis.estimation import pseudo_inertia
from flexviz.base.arrays import Array
from flexviz.base.errors import InputError, choose_from
from flexviz.content.records import Verdict
from flexviz.content.results import ResultDocument, lacks_effects
from flexviz.content.wording import mounting_text, sliding_note
from flexviz.model.effects import EFFECTS, named_effect
from flexviz.model.servo import GAIN, follows_goals
from flexviz.outlets.exporting.coverage import UNREGISTERED, LeftOut, entry_of, servo_entry_of
from flexviz.outlets.exporting.laws import Laws, laws, not_of_robot
from flexviz.robot.model import INERTIAL_NAMES, EffectValue, FlexibleModel
from flexviz.robot.robot import PayloadBody, Robot

if TYPE_CHECKING:
    from flexviz.analysis.diagnosis import Diagnosis
    from flexviz.analysis.identification import Identification
    from flexviz.data.measurements import MeasurementSet

VERDICTS = {
    "missing": "an effect is missing from this model",
    "nothing-missing": "nothing is missing from this model",
    "unknown": "something is missing from this model that no known effect explains",
    "not-searched": "not diagnosed: the search was stopped before it tried anything",
}
MOTOR_SIDE = ("motor_inertia", "motor_viscous_friction")
VECTORS = ("stiffness", "motor_inertia", "link_viscous_friction", "motor_viscous_friction")


@dataclass(frozen=True, eq=False)
class FormatFiles:
    """An export in one format."""

    contents: dict[str, bytes]  # file name -> content, the main file first
    left_out: list[str]  # parts of the model that it does not contain, one line each


@dataclass(frozen=True, eq=False)
class IdentifiedRobot:
    """A robot with its identified model.

    Attributes:
        payload: name of the payload that the exported robot carries.
        verdict: of the diagnosis.
        remarks: warnings in the exported files, one sentence each.
    """

    measurements: MeasurementSet
    document: ResultDocument
    model: FlexibleModel
    payload: str | None = None
    verdict: Verdict | None = None
    remarks: tuple[str, ...] = ()

    @property
    def robot(self) -> Robot:
        """The robot of the set, with its CAD inertias."""
        return self.measurements.robot

    @property
    def torque_limits(self) -> dict[str, float]:
        """Joint → limit of its torque [Nm], of the joints that have one."""
        return {
            e.joint: next(iter(e.parameters.values()))
            for e in self.model.effects
            if e.joint is not None and EFFECTS[e.effect].limits_torque
        }

    @property
    def joints(self) -> tuple[str, ...]:
        """Joint names (n)."""
        return self.robot.joints

    @cached_property
    def name(self) -> str:
        """The robot's name as a file name and C identifier."""
        name = re.sub(r"[^A-Za-z0-9]+", "_", self.robot.name).strip("_").lower() or "robot"
        return name if name[0].isalpha() else f"robot_{name}"

    @cached_property
    def bodies(self) -> tuple[PayloadBody, ...]:
        """The payload's bodies as given in the set."""
        return self.measurements.payloads[self.payload] if self.payload is not None else ()

    @cached_property
    def laws(self) -> Laws:
        """The model's parameters by table."""
        return laws(self.robot, self.model, self.payload, self.bodies)

    @cached_property
    def follows_goals(self) -> bool:
        """Whether its joints follow goals."""
        return follows_goals(self.model)

    @property
    def gravity(self) -> tuple[float, float, float]:
        """Of the base's frame (3,) [m/s²]."""
        return self.robot.gravity if self.follows_goals else self.laws.gravity

    @cached_property
    def inertial(self) -> Array:
        """(n, 10) inertial parameters about the joint frames, including the payload."""
        bodies = self.bodies if self.follows_goals else self.laws.bodies
        return self.model.inertial + self.robot.payload_parameters(bodies)

    @property
    def has_motors(self) -> bool:
        """Whether the model has motors: a torque behind the gears shows nothing of them."""
        return self.document.torque_side != "joint"

    def grade(self, name: str, joint: str) -> str:
        """How well the data determine a parameter: "yes", "weak" or "no"."""
        return self.document[name, joint].identifiable

    @cached_property
    def sha256(self) -> str:
        """Of the measurement set's files."""
        from flexviz.data import measurements

        return measurements.fingerprint(self.measurements).sha256

    def require_bodies(self) -> None:
        """Raise InputError if a joint's inertial parameters are not physically consistent.

        Simulators refuse such links or diverge.
        """
        for joint, row in zip(self.joints, self.inertial, strict=True):
            lowest = float(np.linalg.eigvalsh(pseudo_inertia(row))[0])
            if not lowest > 0.0:
                raise InputError(
                    f"the inertial parameters of {joint} are not physically consistent: the smallest "
                    f"eigenvalue of the pseudo-inertia is {lowest:.3g}, expected a positive one; URDF and "
                    "MJCF cannot be written: identify again, or export --to json, yaml, c, python"
                )

    @property
    def heading(self) -> list[str]:
        """Lines at the top of every exported file."""
        ms, groups = self.measurements, self.document.groups
        lines = [
            f"{self.robot.name}: identified by flexviz {__version__} from the measurement set {ms.name}"
            + (" (simulated data)" if ms.simulated else ""),
            f"SHA-256 of the set: {self.sha256}",
            "All quantities of the motor are expressed at the joint, after the gear. SI units.",
        ]
        if note := sliding_note(self.joints, self.robot.prismatic):
            lines.append(note)
        if groups:
            lines.insert(1, f"Fitted on {', '.join(groups)}" + (", refined" if self.document.refined else ""))
        carried = f"carries the payload {self.payload}" if self.payload else "carries no payload"
        lines.append(f"The robot {carried}.")
        if mounted := mounting_text(self.gravity):
            lines.append(f"Mounting: {mounted}.")
        movable = (x.name for x in self.robot.description.joint_map.values() if x.type != "fixed")
        if locked := [name for name in movable if name not in self.joints]:
            lines.append(
                f"Locked while identified: {', '.join(locked)}. Their inertia is part of what carries them, "
                "their friction is not identified."
            )
        if self.verdict:
            lines.append(f"Diagnosis: {VERDICTS.get(self.verdict, self.verdict)}.")
        return lines + list(self.remarks)

    def left_out(self, target: str) -> list[str]:
        """Effects that a format does not contain: `external_contact:joint1@g2: an event of …`"""
        if self.follows_goals:
            return self._left_out_of_servos(target)
        lines = []
        for effect in self.model.effects:
            found = entry_of(effect.effect, target) or UNREGISTERED
            reason = found.because if isinstance(found, LeftOut) else found.missing
            reason = not_of_robot(effect, self.payload) or reason
            if reason:
                lines.append(f"{effect.text}: {reason}")
        return lines

    def _left_out_of_servos(self, target: str) -> list[str]:
        """The same, one line per effect: `dead_band:a, b (half_width .005, .004 rad): reason; what to do`."""
        lines = []
        for name in dict.fromkeys(effect.effect for effect in self.model.effects):
            found = servo_entry_of(name, target) or UNREGISTERED
            left = isinstance(found, LeftOut)
            reason, remedy = (found.because, found.remedy) if left else (found.missing, "")
            if not reason:
                continue
            own = [effect for effect in self.model.effects if effect.effect == name]
            every = len(own) == self.robot.n > 2
            joints = "all joints" if every else ", ".join(effect.joint or "all joints" for effect in own)
            values = "; ".join(
                f"{p} {', '.join(f'{e.parameters[p]:.4g}' for e in own)} {unit}".removesuffix(" -")
                for p, unit in EFFECTS[name].units.items()
                if any(e.parameters[p] for e in own)
            )
            todo = f"; {remedy}" if remedy else ""
            lines.append(f"{name}:{joints} ({values}): {reason}{todo}")
        return lines


def identified_robot(
    measurements: MeasurementSet,
    result: Identification | Diagnosis | ResultDocument,
    *,
    payload: str | None = None,
    diagnosis: Diagnosis | None = None,
    file: str | Path = "the result",
    remarks: Sequence[str] = (),
) -> IdentifiedRobot:
    """The robot of a set with the model of a result.

    Args:
        measurements: the measurement set of the result.
        result: an identification, a diagnosis (its final model), or a result read from a file.
        payload: name of the payload that the robot carries.
        diagnosis: of the same model, for its verdict.
        file: source of the result, for error messages.
        remarks: additional warnings for the exported files.

    Raises:
        InputError: the result does not belong to the set, or the payload does not exist.
    """
    document = result if isinstance(result, ResultDocument) else result.document()
    check_payload(measurements, payload)
    goals = any(effect.effect == GAIN for effect in document.all_effects)
    model = (servo_of if goals else model_of)(document, measurements.joints, file)
    if goals:
        model = replace(model, inertial=measurements.robot.cad_parameters)
    verdict = document.final_verdict if diagnosis is None else diagnosis.verdict
    found = IdentifiedRobot(measurements, document, model, payload, verdict)
    warnings = list(remarks)
    if not document.converged:
        warnings.append("The identification did not converge: do not rely on these values.")
    if document.torque_side == "joint":
        warnings.append(
            "Motor inertia and motor friction are unknown and zero here: the torque of this model is that "
            "behind the gears, as joint torque sensors measure it, not the motors'."
        )
    if document.stopped:
        warnings.append("The identification was stopped early.")
    if document.set_sha256 is not None and document.set_sha256 != found.sha256:
        warnings.append("The measurement set has changed since this identification.")
    if verdict is None and (lacking := lacks_effects(document)):
        warnings.append(lacking)
    loose = [p for p in document.all_parameters if p.name == f"{GAIN}.gain" and p.identifiable == "no"]
    if loose:
        warnings.append(
            f"Scale of {', '.join(str(p.joint) for p in loose)} not determined: torques, inertia and gain "
            "are known in ratio to each other only."
        )
    found = replace(found, remarks=tuple(warnings))
    assert goals or found.laws  # checks the values, whatever the format
    return found


def check_payload(measurements: MeasurementSet, payload: str | None) -> None:
    """Raise InputError for a payload that the set does not have."""
    if payload is not None and payload not in measurements.payloads:
        valid = choose_from(payload, measurements.payloads)
        raise InputError(f'payload "{payload}" does not exist; {valid}', file=measurements.path)


def model_of(document: ResultDocument, joints: Sequence[str], file: str | Path) -> FlexibleModel:
    """The model with a document's parameters; InputError for one missing, given twice or of no joint."""
    given: dict[str, float] = {}
    for p in document.all_parameters:
        if p.joint is not None and p.joint not in joints:
            found = f'parameter {p.name}: joint "{p.joint}" is not in the set'
            raise InputError(f"{found}; {choose_from(p.joint, joints)}", file=file)
        if p.label in given and "." not in p.name:
            raise InputError(f"parameter {p.label} is given twice", file=file)
        given[p.label] = p.value

    def value(name: str, joint: str) -> float:
        try:
            return given[f"{name}:{joint}"]
        except KeyError:
            raise InputError(f"parameter {name} of {joint} is missing", file=file) from None

    absent = MOTOR_SIDE if document.torque_side == "joint" else ()
    vectors = {
        name: np.array([0.0 if name in absent else value(name, j) for j in joints]) for name in VECTORS
    }
    inertial = np.array([[value(name, j) for name in INERTIAL_NAMES] for j in joints])
    values = []
    for effect in document.all_effects:
        parameters = {name: float(v.value) for name, v in effect.parameters.items()}
        values.append(EffectValue(effect.effect, effect.joint, parameters, effect.group, effect.payload))
        _check_effect(values[-1], file)
    return FlexibleModel(tuple(joints), **vectors, inertial=inertial, effects=tuple(values))


def servo_of(document: ResultDocument, joints: Sequence[str], file: str | Path) -> FlexibleModel:
    """The model of joints that follow goals, whose masses are the robot's."""
    given = {p.label: p.value for p in document.all_parameters}
    try:
        vectors = {name: np.array([given[f"{name}:{joint}"] for joint in joints]) for name in MOTOR_SIDE}
    except KeyError as error:
        raise InputError(f"parameter {error.args[0]} is missing", file=file) from None
    effects = [
        EffectValue(e.effect, e.joint, {name: float(v.value) for name, v in e.parameters.items()})
        for e in document.all_effects
    ]
    n = len(joints)
    rest = {"stiffness": np.full(n, np.inf), "link_viscous_friction": np.zeros(n)}
    return FlexibleModel(tuple(joints), **rest, **vectors, inertial=np.zeros((n, 10)), effects=tuple(effects))


def _check_effect(value: EffectValue, file: str | Path) -> None:
    names = [p.name for p in named_effect(value.effect, file).parameters]
    if set(value.parameters) != set(names):
        found = ", ".join(value.parameters) or "none"
        raise InputError(f"effect {value.text}: parameters {found}, expected {', '.join(names)}", file=file)
