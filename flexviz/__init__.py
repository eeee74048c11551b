"""flexviz: identify flexible-joint robots from motor-side data.

    import flexviz

    measurements = flexviz.read_set("my_robot")
    result = flexviz.identify(measurements, refine=True)
    print(result.summary())
    print(result["stiffness", "joint1"].value)

Everything named in ``__all__`` is loaded when it is first used, so ``import flexviz`` itself is fast.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

# name -> module that defines it
_WHERE = {
    "FlexvizError": "flexviz.errors",
    "InputError": "flexviz.errors",
    "ConvergenceError": "flexviz.errors",
    "Cancelled": "flexviz.errors",
    "Robot": "flexviz.robot",
    "PayloadBody": "flexviz.robot",
    "FlexibleModel": "flexviz.model",
    "EffectValue": "flexviz.model",
    "MeasurementSet": "flexviz.measurements",
    "Group": "flexviz.measurements",
    "Segment": "flexviz.measurements",
    "read_set": "flexviz.measurements",
    "write_set": "flexviz.measurements",
    "Observer": "flexviz.observers",
    "OBSERVERS": "flexviz.observers",
    "EsoGains": "flexviz.observers",
    "make_observer": "flexviz.observers",
    "sweep": "flexviz.identification",
    "SweepResult": "flexviz.identification",
    "identify": "flexviz.identification",
    "Identification": "flexviz.identification",
    "Iteration": "flexviz.progress",
    "Progress": "flexviz.progress",
    "ParameterEstimate": "flexviz.identification",
    "ResidualSummary": "flexviz.identification",
    "diagnose": "flexviz.diagnosis",
    "Diagnosis": "flexviz.diagnosis",
    "Finding": "flexviz.diagnosis",
    "design": "flexviz.designing",
    "Design": "flexviz.designing",
    "DesignSettings": "flexviz.designing",
    "write_design": "flexviz.designing",
    "load_effects": "flexviz.effects",
    "simulate_run": "flexviz.simulation",
    "replay": "flexviz.simulation",
    "export": "flexviz.exporting",
    "import_logs": "flexviz.importing",
    "ParameterNotFound": "flexviz.results",
    "ResultDocument": "flexviz.results",
    "read_result": "flexviz.results",
    "Session": "flexviz.session:OpenedSession",
    "on_cores": "flexviz.parallel",
    "record": "flexviz.workflows",
    "write_report": "flexviz.workflows",
}

if TYPE_CHECKING:
    from flexviz.designing import Design, DesignSettings, design, write_design
    from flexviz.diagnosis import Diagnosis, Finding, diagnose
    from flexviz.effects import load_effects
    from flexviz.errors import Cancelled, ConvergenceError, FlexvizError, InputError
    from flexviz.exporting import export
    from flexviz.identification import (
        Identification,
        ParameterEstimate,
        ResidualSummary,
        SweepResult,
        identify,
        sweep,
    )
    from flexviz.importing import import_logs
    from flexviz.measurements import Group, MeasurementSet, Segment, read_set, write_set
    from flexviz.model import EffectValue, FlexibleModel
    from flexviz.observers import OBSERVERS, EsoGains, Observer, make_observer
    from flexviz.parallel import on_cores
    from flexviz.progress import Iteration, Progress
    from flexviz.results import ParameterNotFound, ResultDocument, read_result
    from flexviz.robot import PayloadBody, Robot
    from flexviz.session import OpenedSession as Session
    from flexviz.simulation import replay, simulate_run
    from flexviz.workflows import record, write_report

__all__ = [
    "OBSERVERS",
    "Cancelled",
    "ConvergenceError",
    "Design",
    "DesignSettings",
    "Diagnosis",
    "EffectValue",
    "EsoGains",
    "Finding",
    "FlexibleModel",
    "FlexvizError",
    "Group",
    "Identification",
    "InputError",
    "Iteration",
    "MeasurementSet",
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


def __dir__() -> list[str]:
    return sorted(__all__)
