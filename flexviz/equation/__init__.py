"""The identification equation: signals in, residual and Jacobian out."""

from flexviz.equation.layout import INERTIAL_NAMES, Layout, layout_of
from flexviz.equation.residual import Equation, Evaluation
from flexviz.equation.signals import Signals, build_signals

__all__ = ["INERTIAL_NAMES", "Equation", "Evaluation", "Layout", "Signals", "build_signals", "layout_of"]
