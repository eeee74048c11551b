"""What the screen shows, computed: charts, tables and sentences of results as plain data.

Nothing here knows a browser. The app renders it, report and recording print it, tests read it.
"""

from flexviz.view.convergence import convergence_plots, progress_text
from flexviz.view.effect_card import card_html
from flexviz.view.effects import (
    COMMON_EFFECTS,
    addable_effects,
    effect_hint,
    effects_note,
    more_effects,
    why_fixed,
)
from flexviz.view.evidence import evidence_plot
from flexviz.view.identifiability import check_html, listed
from flexviz.view.next_step import next_step, steps_done
from flexviz.view.signals import signals_plots
from flexviz.view.staircase import FLOOR, curves, staircase_html, staircase_plots, stepped, treads
from flexviz.view.states import numbers_html, observer_for, observer_numbers, states_plots
from flexviz.view.status import (
    error_text,
    joint_colours,
    joint_rms,
    legend_html,
    status_html,
    step_line_html,
    total_rms,
)
from flexviz.view.sweep import sweep_bandwidths, sweep_html, sweep_plots
from flexviz.view.tables import parameters_html, set_html, truth_html, truth_values
from flexviz.view.verdict import finding_html, heading_html, verdict_html
from flexviz.view.where import VARIABLES, ResidualSamples, groups_html, range_html, shaded, time_residual
from flexviz.view.where_maps import MAP_COLUMNS, free_html, free_plot, map_html, map_of, map_plots

__all__ = [
    "COMMON_EFFECTS",
    "FLOOR",
    "MAP_COLUMNS",
    "VARIABLES",
    "ResidualSamples",
    "addable_effects",
    "card_html",
    "check_html",
    "convergence_plots",
    "curves",
    "effect_hint",
    "effects_note",
    "error_text",
    "evidence_plot",
    "finding_html",
    "free_html",
    "free_plot",
    "groups_html",
    "heading_html",
    "joint_colours",
    "joint_rms",
    "legend_html",
    "listed",
    "map_html",
    "map_of",
    "map_plots",
    "more_effects",
    "next_step",
    "numbers_html",
    "observer_for",
    "observer_numbers",
    "parameters_html",
    "progress_text",
    "range_html",
    "set_html",
    "shaded",
    "signals_plots",
    "staircase_html",
    "staircase_plots",
    "states_plots",
    "status_html",
    "step_line_html",
    "stepped",
    "steps_done",
    "sweep_bandwidths",
    "sweep_html",
    "sweep_plots",
    "time_residual",
    "total_rms",
    "treads",
    "truth_html",
    "truth_values",
    "verdict_html",
    "why_fixed",
]
