"""The parameters that are compared with the truth: base inertial, stiffness, motor inertia, friction."""

from __future__ import annotations

from dataclasses import dataclass

from flexviz.analysis.identification import Identification
from flexviz.base.statistics import NORMAL_95
from flexviz.model.simulation.sets import true_parameters
from flexviz.robot.model import FlexibleModel

# class of parameter → names in the result
CLASSES = {
    "inertial": ("inertial",),
    "stiffness": ("stiffness",),
    "motor inertia": ("motor_inertia",),
    "friction split": ("link_viscous_friction", "motor_viscous_friction"),
    "friction sum": ("viscous_friction_sum",),
}
LABELS = {
    "stiffness": "K",
    "motor_inertia": "B",
    "link_viscous_friction": "f_l",
    "motor_viscous_friction": "f_m",
    "viscous_friction_sum": "f_l+f_m",
}


@dataclass(frozen=True)
class Row:
    """One parameter beside its truth.

    Attributes:
        kind: a key of `CLASSES`.
        label: for tables, "K joint1".
        value, std, truth: in `unit`.
        identifiable: what the program says of it: "yes", "weak" or "no".
    """

    kind: str
    label: str
    value: float
    std: float
    truth: float
    unit: str
    identifiable: str

    @property
    def error(self) -> float:
        """Absolute error."""
        return self.value - self.truth

    @property
    def relative(self) -> float:
        """Error relative to the truth."""
        return self.error / abs(self.truth)

    @property
    def score(self) -> float:
        """Error in standard errors."""
        return self.error / self.std if self.std > 0 else 0.0

    @property
    def covered(self) -> bool:
        """Whether the 95 % interval holds the truth."""
        return abs(self.score) <= NORMAL_95

    def within(self, relative: float, absolute: float = 0.0) -> bool:
        """Whether the error is at most `relative` of the truth, or at most `absolute`."""
        return abs(self.error) <= max(relative * abs(self.truth), absolute)


def compare(result: Identification, model: FlexibleModel) -> list[Row]:
    """Every identified quantity that the motion can show, with its truth."""
    true = {f"{p['name']}:{p['joint']}": float(p["value"]) for p in true_parameters(model, [False] * model.n)}
    rows = [
        Row(
            "inertial",
            _short(c.name),
            c.value,
            c.std,
            sum(weight * true[name] for name, weight in c.weights.items()),
            c.unit,
            c.identifiable,
        )
        for c in result.combinations
    ]
    kind_of = {name: kind for kind, names in CLASSES.items() for name in names}
    for p in result.parameters:
        if p.name in LABELS:
            label, place = f"{LABELS[p.name]} {p.joint}", true[f"{p.name}:{p.joint}"]
            rows.append(Row(kind_of[p.name], label, p.value, p.std, place, p.unit, p.identifiable))
    return sorted(rows, key=lambda row: list(CLASSES).index(row.kind))


def _short(name: str) -> str:
    """ "izz:joint1 + 1 mass:joint2" → "izzR joint1": R for regrouped."""
    first, *rest = name.split(" ")
    parameter, joint = first.split(":")
    return f"{parameter}{'R' if rest else ''} {joint}"
