"""One row per set: what was found, or why nothing was."""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

from pydantic import ValidationError

from flexviz.content.records import ParameterEstimate, mean_nrms, total_rms
from flexviz.content.results import ResultDocument
from flexviz.content.wording import confidence_of, percent, quantity, tied_families
from flexviz.model.effects import free_curve
from flexviz.outlets.batch.sources import BatchSet
from flexviz.outlets.batch.tasks import TaskResult
from flexviz.robot.model import INERTIAL_NAMES

DONE, FAILED, WAITING = "done", "failed", "not done"


@dataclass(frozen=True)
class FleetRow:
    """One set of a fleet.

    Attributes:
        set, path, robot, date, date_from, sha256, description, description_sha256: see `BatchSet`.
        key: of its task, by which its results document is found.
        state: "done", "failed" or "not done".
        error: why it failed.
        verdict: of the diagnosis of the set's own model; "" without a diagnosis.
        final_verdict: of its last model.
        found: effects that were added, as "coulomb_friction:joint2".
        confidence: of the first of them, or of the family that it stands for.
        residual: error on held-out groups (of the fit where there are none) relative to the torque, mean of
            the joints.
        residual_before: the same of the set's own model.
        converged: whether the identification did.
        seconds: that the work took.
        parameters: "stiffness:joint1" -> value; inertial parameters are left out.
        families: for each effect in `found` the family that it stands for, where the data do not tell which
            kind; "" where they do. Empty in tables that earlier versions wrote.
        residual_torque, residual_torque_before: the errors of the last and of the set's own model, root mean
            square of the joints [Nm]; None in tables that earlier versions wrote.
    """

    set: str
    path: str
    robot: str
    date: str
    date_from: str
    sha256: str
    description: str
    description_sha256: str
    key: str
    state: str
    error: str
    verdict: str
    final_verdict: str
    found: tuple[str, ...]
    confidence: float | None
    residual: float | None
    residual_before: float | None
    converged: bool | None
    seconds: float | None
    parameters: dict[str, ParameterEstimate]
    families: tuple[str, ...] = ()
    residual_torque: float | None = None
    residual_torque_before: float | None = None

    @property
    def error_text(self) -> str:
        """The error of the last model: "1.2 % of the torque (0.31 Nm)"."""
        return _told(self.residual, self.residual_torque)

    @property
    def error_text_before(self) -> str:
        """The same of the set's own model."""
        return _told(self.residual_before, self.residual_torque_before)

    @property
    def named(self) -> list[tuple[str, str]]:
        """(effect, family that it stands for or "") of what was added."""
        return list(zip_longest(self.found, self.families[: len(self.found)], fillvalue=""))

    @property
    def day(self) -> str:
        """Of the date, with an asterisk if that is only the date of the files."""
        return self.date[:10] + ("*" if self.date_from == "file" else "")

    @property
    def when(self) -> dt.datetime | None:
        """The date as an instant, for computing: without its time zone, UTC is assumed."""
        try:
            instant = dt.datetime.fromisoformat(self.date)
        except ValueError:
            return None
        return instant if instant.tzinfo else instant.replace(tzinfo=dt.UTC)


def fleet_row(one: BatchSet, key: str, result: TaskResult | None) -> FleetRow:
    """The row of a set; without a result it failed to open or was not done."""
    known = dict(one.__dict__)
    error = known.pop("error") or (result.error if result is not None else "")
    common: dict[str, Any] = {"set": known.pop("name"), **known, "path": str(one.path), "key": key}
    if result is not None and not error:
        try:
            return _done(common, result)
        except (ValidationError, KeyError, TypeError, ValueError) as wrong:
            error = f"its result cannot be read ({type(wrong).__name__}); run it again with --retry"
    nothing: dict[str, Any] = dict.fromkeys(("confidence", "residual", "residual_before", "converged"))
    nothing |= {"verdict": "", "final_verdict": "", "found": (), "parameters": {}}
    nothing["seconds"] = None if result is None else result.seconds
    return FleetRow(**common, **nothing, state=FAILED if error else WAITING, error=error)


def _done(common: dict[str, Any], result: TaskResult) -> FleetRow:
    content = result.result or {}
    identified = ResultDocument.from_dict(content["identification"])
    diagnosed = ResultDocument.from_dict(content["diagnosis"]) if content.get("diagnosis") else None
    final = diagnosed or identified
    steps = (step.added for step in diagnosed.steps) if diagnosed else ()
    added = [one for one in steps if one is not None and free_curve(one.effect) is None]
    families = tied_families(added)
    before, after, spread = _errors(identified, diagnosed)
    return FleetRow(
        **common,
        state=DONE,
        error="",
        verdict=(diagnosed.verdict or "") if diagnosed else "",
        final_verdict=(diagnosed.final_verdict or "") if diagnosed else "",
        found=tuple(one.text for one in added),
        confidence=confidence_of(added[0]) if added else None,
        residual=_share(after, spread),
        residual_before=_share(before, spread),
        residual_torque=total_rms(after) if after else None,
        residual_torque_before=total_rms(before) if before else None,
        converged=identified.converged,
        seconds=result.seconds,
        parameters={
            p.label: p
            for p in final.all_parameters
            if p.name not in INERTIAL_NAMES and free_curve(p.name) is None
        },
        families=tuple(families.get(one.text, "") for one in added),
    )


def _errors(
    identified: ResultDocument, diagnosed: ResultDocument | None
) -> tuple[Sequence[float], Sequence[float], Sequence[float]]:
    """Errors of the first and the last model per joint, in the same band, and the torque's spread [Nm]."""
    final = (diagnosed or identified).final_errors
    if final is None:
        return (), (), ()
    first = diagnosed.steps[0] if diagnosed is not None and diagnosed.steps else final
    return first.rms_validation or first.rms, final.rms_validation or final.rms, final.torque_spread


def _share(rms: Sequence[float], spread: Sequence[float]) -> float | None:
    share = mean_nrms(rms, spread) if rms and len(rms) == len(spread) else math.nan
    return share if math.isfinite(share) else None


def _told(share: float | None, torque: float | None) -> str:
    told = "–" if share is None else f"{percent(share)} of the torque"
    return told if torque is None else f"{told} ({quantity(torque, 'Nm', 2)})"
