"""A user's own effect, drafted from the free curve of a diagnosis."""

from __future__ import annotations

from dataclasses import dataclass

from flexviz.diagnosis.result import Diagnosis
from flexviz.effects import EFFECTS, CurveForm, draft_effect
from flexviz.results import curve_tables


@dataclass(frozen=True)
class CurveDraft:
    """A drafted effect file.

    Attributes:
        form: the simple law.
        joint: where the curve was found.
        content: of the file, a Python program.
    """

    form: CurveForm
    joint: str
    content: str

    @property
    def name(self) -> str:
        """Of the file."""
        return f"{self.form.kind}_of_{self.form.variable}.py"


def draft_from_curve(diagnosis: Diagnosis) -> CurveDraft | None:
    """The effect drafted from the last free curve of the model, or else from that of the residual.

    None if there is no curve, or none that resembles a simple law.
    """
    for table in reversed(curve_tables(diagnosis.parameters)):
        form = table.simple_form()
        if form is not None and table.joint is not None:
            link = EFFECTS[table.effect].where == "link"
            return CurveDraft(form, table.joint, draft_effect(form, table.joint, diagnosis.set_name, link))
    curve = diagnosis.free_curve
    form = curve.simple_form() if curve is not None and curve.form else None
    if curve is None or form is None or not curve.effects:
        return None
    return CurveDraft(form, curve.joint, draft_effect(form, curve.joint, diagnosis.set_name))
