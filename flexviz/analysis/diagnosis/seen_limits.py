"""Limits of the torque that the record itself shows, as findings: no search is needed for them."""

from __future__ import annotations

from flexviz.analysis.diagnosis.result import Finding
from flexviz.checks import SeenLimit, seen_limits
from flexviz.content.records import EffectParameter
from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import EFFECTS


def limit_findings(measurements: MeasurementSet) -> list[Finding]:
    """One finding per joint whose recorded torque stands at a limit, certain: the data show it.

    Its samples at the limit are left out of all fits, so that it removes no error (`score` 0).
    """
    slides = measurements.robot.prismatic
    return [_finding(one, measurements.joints, bool(slides[one.joint])) for one in seen_limits(measurements)]


def _finding(one: SeenLimit, joints: tuple[str, ...], slides: bool) -> Finding:
    law = next(effect for effect in EFFECTS.values() if effect.limits_torque)
    spec = law.parameters[0]
    limit = EffectParameter(one.limit, one.tolerance, spec.unit_on(slides))
    return Finding(law.name, joints[one.joint], score=0.0, confidence=1.0, parameters={spec.name: limit})
