"""flexviz: identify flexible-joint robots from motor-side data.

    import flexviz

    measurements = flexviz.read_set("my_robot")
    result = flexviz.identify(measurements, effects=["coulomb_friction"])
    print(result.summary())
    print(result["stiffness", "joint1"].value)

Everything named in ``__all__`` is loaded when it is first used, so ``import flexviz`` itself is fast.
"""

from __future__ import annotations

import time
from importlib import import_module
from typing import TYPE_CHECKING, Any

from flexviz.facts import Fact

__version__ = "0.1.0"
STARTED = time.monotonic()  # [s]

_NAMES = {
    "designing": "Design DesignSettings design write_design",
    "diagnosis": "Diagnosis Finding diagnose",
    "effects": "load_effects",
    "charts": "Figure",
    "errors": "Cancelled ConvergenceError FlexvizError InputError MissingPackage",
    "exporting": "export",
    "identification": "FitSettings Identification SweepResult identify sweep",
    "importing": "import_logs",
    "iteration": "Iteration",
    "measurements": "Group MeasurementSet Segment read_set write_set",
    "model": "EffectValue FlexibleModel",
    "observers": "OBSERVERS EsoGains LiveObserver Observer make_observer",
    "parallel": "on_cores",
    "progress": "Progress",
    "records": "CriterionNumbers Interval ParameterEstimate ResidualSummary",
    "results": "ParameterNotFound ResultDocument read_result",
    "robot": "PayloadBody Robot",
    "simulation": "replay simulate_run",
    "workflows": "record write_report",
}  # module -> what it defines
_WHERE = {name: f"flexviz.{module}" for module, names in _NAMES.items() for name in names.split()}
_WHERE["Session"] = "flexviz.session:OpenedSession"

if TYPE_CHECKING:
    from flexviz.charts import Figure
    from flexviz.designing import Design, DesignSettings, design, write_design
    from flexviz.diagnosis import Diagnosis, Finding, diagnose
    from flexviz.effects import load_effects
    from flexviz.errors import Cancelled, ConvergenceError, FlexvizError, InputError, MissingPackage
    from flexviz.exporting import export
    from flexviz.identification import FitSettings, Identification, SweepResult, identify, sweep
    from flexviz.importing import import_logs
    from flexviz.iteration import Iteration
    from flexviz.measurements import Group, MeasurementSet, Segment, read_set, write_set
    from flexviz.model import EffectValue, FlexibleModel
    from flexviz.observers import OBSERVERS, EsoGains, LiveObserver, Observer, make_observer
    from flexviz.parallel import on_cores
    from flexviz.progress import Progress
    from flexviz.records import CriterionNumbers, Interval, ParameterEstimate, ResidualSummary
    from flexviz.results import ParameterNotFound, ResultDocument, read_result
    from flexviz.robot import PayloadBody, Robot
    from flexviz.session import OpenedSession as Session
    from flexviz.simulation import replay, simulate_run
    from flexviz.workflows import record, write_report

__all__ = [
    "OBSERVERS",
    "Cancelled",
    "ConvergenceError",
    "CriterionNumbers",
    "Design",
    "DesignSettings",
    "Diagnosis",
    "EffectValue",
    "EsoGains",
    "Figure",
    "Finding",
    "FitSettings",
    "FlexibleModel",
    "FlexvizError",
    "Group",
    "Identification",
    "InputError",
    "Interval",
    "Iteration",
    "LiveObserver",
    "MeasurementSet",
    "MissingPackage",
    "Observer",
    "ParameterEstimate",
    "ParameterNotFound",
    "PayloadBody",
    "Progress",
    "ResidualSummary",
    "ResultDocument",
    "Robot",
    "Segment",
    "Session",
    "SweepResult",
    "__version__",
    "design",
    "diagnose",
    "export",
    "identify",
    "import_logs",
    "load_effects",
    "make_observer",
    "on_cores",
    "read_result",
    "read_set",
    "record",
    "replay",
    "simulate_run",
    "sweep",
    "write_design",
    "write_report",
    "write_set",
]


def __getattr__(name: str) -> Any:
    if name in _WHERE:
        module, _, attribute = _WHERE[name].partition(":")
        value = getattr(import_module(module), attribute or name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'flexviz' has no attribute {name!r}")


def _in_words(fact: Fact) -> str:
    return import_module("flexviz.wording").fact_text(fact)


Fact.words = _in_words  # facts know no words, which stand above them


def __dir__() -> list[str]:
    return sorted(__all__)
