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
from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any

from flexviz.base.facts import Fact
from flexviz.base.hooks import SetChecks
from flexviz.base.pages import Shown

__version__ = "0.1.0"
STARTED = time.monotonic()  # [s]

_NAMES = {
    "analysis.designing": "Design DesignSettings design write_design",
    "analysis.diagnosis": "Diagnosis Finding diagnose",
    "analysis.identification": "FitSettings Identification SweepResult identify sweep",
    "base.errors": "Cancelled ConvergenceError FlexvizError InputError MissingPackage",
    "base.iteration": "Iteration",
    "base.parallel": "on_cores",
    "base.progress": "Progress",
    "content.charts": "Figure",
    "content.records": "CriterionNumbers Interval ParameterEstimate ResidualSummary",
    "content.results": "ParameterNotFound ResultDocument read_result",
    "data.importing": "import_logs",
    "data.measurements": "Group MeasurementSet Segment read_set write_set",
    "model.effects": "load_effects",
    "model.observers": "OBSERVERS EsoGains LiveObserver Observer make_observer",
    "model.simulation": "replay simulate_run",
    "outlets.exporting": "export",
    "outlets.workflows": "record write_report",
    "robot.model": "EffectValue FlexibleModel",
    "robot.robot": "PayloadBody Robot",
}  # module -> what it defines
_WHERE = {name: f"flexviz.{module}" for module, names in _NAMES.items() for name in names.split()}
_WHERE["Session"] = "flexviz.content.session:OpenedSession"

if TYPE_CHECKING:
    from flexviz.analysis.designing import Design, DesignSettings, design, write_design
    from flexviz.analysis.diagnosis import Diagnosis, Finding, diagnose
    from flexviz.analysis.identification import FitSettings, Identification, SweepResult, identify, sweep
    from flexviz.base.errors import Cancelled, ConvergenceError, FlexvizError, InputError, MissingPackage
    from flexviz.base.iteration import Iteration
    from flexviz.base.parallel import on_cores
    from flexviz.base.progress import Progress
    from flexviz.content.charts import Figure
    from flexviz.content.records import CriterionNumbers, Interval, ParameterEstimate, ResidualSummary
    from flexviz.content.results import ParameterNotFound, ResultDocument, read_result
    from flexviz.content.session import OpenedSession as Session
    from flexviz.data.importing import import_logs
    from flexviz.data.measurements import Group, MeasurementSet, Segment, read_set, write_set
    from flexviz.model.effects import load_effects
    from flexviz.model.observers import OBSERVERS, EsoGains, LiveObserver, Observer, make_observer
    from flexviz.model.simulation import replay, simulate_run
    from flexviz.outlets.exporting import export
    from flexviz.outlets.workflows import record, write_report
    from flexviz.robot.model import EffectValue, FlexibleModel
    from flexviz.robot.robot import PayloadBody, Robot

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
    return import_module("flexviz.content.wording").fact_text(fact)


def _in_blocks(result: Any) -> Any:
    return import_module("flexviz.content.topics").blocks_of(result)


def _of_checks(name: str) -> Callable[[Any], Any]:
    return lambda measurements: getattr(import_module("flexviz.checks"), name)(measurements)


Fact.words = _in_words  # facts know no words, which stand above them
Shown.blocks = _in_blocks  # nor do results know what is said of them
SetChecks.refuse = _of_checks("refuse_wrong_units")  # nor do data know what they are compared with
SetChecks.seen_limits = _of_checks("seen_limits")


def __dir__() -> list[str]:
    return sorted(__all__)
