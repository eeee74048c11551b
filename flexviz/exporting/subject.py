"""What is exported: a robot, the model that was found for it, and what is known about both."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flexviz import __version__
from flexviz.errors import InputError, choose_from
from flexviz.estimation import pseudo_inertia
from flexviz.exporting.coverage import UNREGISTERED, LeftOut, entry_of
from flexviz.exporting.documents import Document, Parameter, model_of, plain
from flexviz.exporting.laws import laws, not_of_robot
from flexviz.model import EffectValue, FlexibleModel
from flexviz.robot import PayloadBody, Robot

if TYPE_CHECKING:
    from flexviz.diagnosis import Diagnosis
    from flexviz.exporting.laws import Laws
    from flexviz.identification import Identification
    from flexviz.measurements import MeasurementSet

Array = NDArray[np.float64]
GRADES = ("yes", "weak", "no")
VERDICTS = {
    "missing": "an effect is missing from this model",
    "nothing-missing": "nothing is missing from this model",
    "unknown": "something is missing from this model that no known effect explains",
}


@dataclass(frozen=True, eq=False)
class Subject:
    """What is exported.

    Attributes
    ----------
    measurements: the set that the result belongs to.
    document: the result.
    model: its model.
    payload: name of the payload that the robot carries in the export, or None.
    verdict: of the diagnosis, or None where there was none.
    remarks: what else a reader of the exported files should know, a sentence each.
    """

    measurements: MeasurementSet
    document: Document
    model: FlexibleModel
    payload: str | None = None
    verdict: str | None = None
    remarks: tuple[str, ...] = ()

    @property
    def robot(self) -> Robot:
        """The robot as the set gives it, with its CAD inertias."""
        return self.measurements.robot

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the n joints."""
        return self.robot.joints

    @cached_property
    def name(self) -> str:
        """The robot's name as a file and a C program can have it."""
        name = re.sub(r"[^A-Za-z0-9]+", "_", self.robot.name).strip("_").lower() or "robot"
        return name if name[0].isalpha() else f"robot_{name}"

    @cached_property
    def bodies(self) -> tuple[PayloadBody, ...]:
        """The payload's bodies, as the set gives them."""
        return self.measurements.payloads[self.payload] if self.payload is not None else ()

    @cached_property
    def laws(self) -> Laws:
        """The model's effects, sorted for exporters."""
        return laws(self.robot, self.model, self.payload, self.bodies)

    @cached_property
    def inertial(self) -> Array:
        """(n, 10) inertial parameters about the joint frames, the payload among them."""
        return self.model.inertial + self.robot.payload_parameters(self.laws.bodies)

    @cached_property
    def _parameters(self) -> dict[str, Parameter]:
        return {p.label: p for p in self.document.all_parameters}

    def grade(self, name: str, joint: str) -> str:
        """How well the data determine a parameter: "yes", "weak" or "no"."""
        return self._parameters[f"{name}:{joint}"].identifiable

    def estimate(self, effect: EffectValue, name: str) -> Parameter | None:
        """What is known about an effect's parameter; None where the result does not list it."""
        place = (effect.joint, effect.payload, effect.group)
        full = ":".join(part for part in (f"{effect.effect}.{name}", *place) if part)
        return self._parameters.get(full)

    def std(self, effect: EffectValue, name: str) -> float | None:
        """Standard error of an effect's parameter as the result's list of effects gives it."""
        place = (effect.effect, effect.joint, effect.group, effect.payload)
        for entry in self.document.all_effects or ():
            if (entry.effect, entry.joint, entry.group, entry.payload) == place:
                return entry.parameters[name].std
        return None

    def graded(self, names: Sequence[str], joint: str) -> dict[str, list[str]]:
        """Grade -> those of `names` that have it."""
        return {grade: [n for n in names if self.grade(n, joint) == grade] for grade in GRADES}

    @cached_property
    def sha256(self) -> str:
        """Of the measurement set's files."""
        from flexviz.measurements import fingerprint

        return fingerprint(self.measurements).sha256

    def require_bodies(self) -> None:
        """InputError where a link's inertial parameters belong to no body that could exist.

        Simulators refuse such links or run away with them, so that a model with them is no model. The
        identification itself never leaves the bodies that can exist.
        """
        for joint, row in zip(self.joints, self.inertial, strict=True):
            lowest = float(np.linalg.eigvalsh(pseudo_inertia(row))[0])
            if not lowest > 0.0:
                raise InputError(
                    f"the inertial parameters of what {joint} moves belong to no body that could exist (its "
                    f"pseudo-inertia has the eigenvalue {lowest:.3g}, all have to be positive): URDF and "
                    "MJCF are not written; identify again, or export --to json, yaml, c, python"
                )

    @property
    def heading(self) -> list[str]:
        """Lines that say at the top of every file what it is."""
        ms = self.measurements
        groups = self.document.groups
        lines = [
            f"{self.robot.name}: identified by flexviz {__version__} from the measurement set {ms.name}"
            + (" (simulated data)" if ms.simulated else ""),
            f"SHA-256 of the set: {self.sha256}",
            "All quantities of the motor are expressed at the joint, after the gear. SI units.",
        ]
        if groups:
            lines.insert(1, f"Fitted on {', '.join(groups)}" + (", refined" if self.document.refined else ""))
        carried = f"carries the payload {self.payload}" if self.payload else "carries no payload"
        lines.append(f"The robot {carried}.")
        if self.verdict:
            lines.append(f"Diagnosis: {VERDICTS.get(self.verdict, self.verdict)}.")
        return lines + list(self.remarks)


def subject_of(
    measurements: MeasurementSet,
    result: Identification | Diagnosis | Document,
    *,
    payload: str | None = None,
    diagnosis: Diagnosis | None = None,
    file: str | Path = "the result",
    remarks: Sequence[str] = (),
) -> Subject:
    """What is exported of a result.

    Args:
        measurements: the set it belongs to.
        result: an identification, a diagnosis (its final model), or what was read from a file.
        payload: name of one of the set's payloads that the robot is to carry.
        diagnosis: of the same model, for its verdict.
        file: where the result comes from, for errors.
        remarks: what else the exported files are to say, a sentence each.

    Raises:
        InputError: the result does not fit the set, or the payload does not exist.
    """
    document = result if isinstance(result, Document) else plain(result.to_json())
    check_payload(measurements, payload)
    model = model_of(document, measurements.joints, file)
    verdict = document.final_verdict if diagnosis is None else diagnosis.verdict
    subject = Subject(measurements, document, model, payload, verdict)
    said = list(remarks)
    if not document.converged:
        said.append("The identification did not converge: do not rely on these values.")
    if document.stopped:
        said.append("The identification was stopped before its end.")
    if document.set_sha256 is not None and document.set_sha256 != subject.sha256:
        said.append("The measurement set has changed since these values were found.")
    subject = replace(subject, remarks=tuple(said))
    assert subject.laws  # values that make no robot are refused here, whatever is exported
    return subject


def check_payload(measurements: MeasurementSet, payload: str | None) -> None:
    """InputError for a payload that the set does not have."""
    if payload is not None and payload not in measurements.payloads:
        valid = choose_from(payload, measurements.payloads)
        raise InputError(f'payload "{payload}" does not exist; {valid}', file=measurements.path)


def left_out(subject: Subject, target: str) -> list[str]:
    """What a format does not hold of the model's effects: `external_contact:joint1@g2: an event of ...`"""
    lines = []
    for effect in subject.model.effects:
        found = entry_of(effect.effect, target) or UNREGISTERED
        reason = found.because if isinstance(found, LeftOut) else found.missing
        reason = not_of_robot(effect, subject.payload) or reason
        if reason:
            lines.append(f"{effect.text}: {reason}")
    return lines
