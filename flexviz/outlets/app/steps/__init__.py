"""The steps of an analysis: controls, tasks, commands. A new step is one file and one line in `STEPS`."""

from flexviz.outlets.app.steps.data import DataStep
from flexviz.outlets.app.steps.diagnose import DiagnoseStep
from flexviz.outlets.app.steps.identify import IdentifyStep
from flexviz.outlets.app.steps.observer import ObserverStep
from flexviz.outlets.app.steps.step import WorkflowStep

STEPS: tuple[type[WorkflowStep], ...] = (
    DataStep,
    ObserverStep,
    IdentifyStep,
    DiagnoseStep,
)

__all__ = ["STEPS", "WorkflowStep"]
