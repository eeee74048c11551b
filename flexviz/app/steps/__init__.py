"""The steps of an analysis: controls, tasks, commands. A new step is one file and one line in `STEPS`."""

from flexviz.app.steps.data import DataStep
from flexviz.app.steps.diagnose import DiagnoseStep
from flexviz.app.steps.identify import IdentifyStep
from flexviz.app.steps.observer import ObserverStep
from flexviz.app.steps.step import WorkflowStep

STEPS: tuple[type[WorkflowStep], ...] = (
    DataStep,
    ObserverStep,
    IdentifyStep,
    DiagnoseStep,
)

__all__ = ["STEPS", "WorkflowStep"]
