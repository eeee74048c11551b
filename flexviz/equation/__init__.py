"""The identification equation: signals in, residual and Jacobian out."""

from flexviz.equation.chain import Chain, local_compliance, time_constants
from flexviz.equation.layout import RIGID, Layout, layout_of
from flexviz.equation.link import LinkDynamics, LinkTerms
from flexviz.equation.motions import viscous_scale
from flexviz.equation.products import FilteredProducts
from flexviz.equation.residual import Equation, Evaluation, OperatingPoint
from flexviz.equation.reversal_nuisance import PulseGroup, Pulses, pulses, side_by_side
from flexviz.equation.signals import Block, Signals, build_signals, equation_stride
from flexviz.equation.torque_side import behind_gear, torque_evidence
