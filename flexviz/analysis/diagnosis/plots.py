"""A diagnosis as figures: `diagnosis.plot.staircase()`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from flexviz.analysis.identification import laws_figure
from flexviz.base.errors import InputError, choose_from
from flexviz.content.charts import Figure
from flexviz.content.results import evidence_chart, staircase_chart


@dataclass(frozen=True, eq=False)
class DiagnosisPlots:
    """Figures of a diagnosis; a notebook displays them, `save` writes them."""

    result: Any  # a Diagnosis

    def residual(self, joint: str | None = None, group: str = "") -> Figure:
        """The residual before each added effect and what the effect explains of it, on one joint or on all.

        `group` is by default the one in which the effect explains most.
        """
        found = [one for one in self.result.findings if one.evidence is not None]
        charts = [evidence_chart(one, group) for one in found if joint in (None, one.evidence.joint)]
        if not charts:
            valid = choose_from(joint or "", dict.fromkeys(one.evidence.joint for one in found))
            raise InputError(f"no effect was added there; {valid}", file=self.result.set_name)
        return Figure(tuple(charts))

    def staircase(self, joint: str | None = None) -> Figure:
        """The error after each added effect, of one joint or over all."""
        result = self.result
        joints = () if result.model is None else result.model.joints
        if joint is not None and joint not in joints:
            valid = choose_from(joint, joints)
            raise InputError(f'joint "{joint}" is not in the set; {valid}', file=result.set_name)
        ticks = ["set's model", *(step.added.text for step in result.steps if step.added is not None)]
        index = None if joint is None else joints.index(joint)
        return Figure((staircase_chart(result.steps, index, joint or "", ticks, result.torque_spread),))

    def law(self, effect: str, joint: str | None = None) -> Figure:
        """The law of a found effect through its data: what the model leaves, plus the effect itself.

        Raises:
            InputError: for an effect or joint that is not among the findings that were added.
        """
        laws = [one.law for one in self.result.findings if one.law is not None]
        return laws_figure(laws, effect, joint, self.result.set_name)
