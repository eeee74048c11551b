"""The identification equation: signals in, residual and Jacobian out."""

from flexviz.model.equation.chain import Chain, local_compliance, time_constants
from flexviz.model.equation.layout import RIGID, Layout, layout_of
from flexviz.model.equation.link import LinkDynamics, LinkTerms
from flexviz.model.equation.motions import viscous_scale
from flexviz.model.equation.products import FilteredProducts
from flexviz.model.equation.residual import Equation, Evaluation, OperatingPoint
from flexviz.model.equation.reversal_nuisance import PulseGroup, Pulses, pulses, side_by_side
from flexviz.model.equation.signals import Block, Signals, build_signals, equation_stride
