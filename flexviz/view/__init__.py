"""What the screen shows, computed: charts, tables and sentences of results as plain data.

Nothing here knows a browser. The app renders it, report and recording print it, tests read it.
"""

from flexviz.view.effect_card import card_html
from flexviz.view.effects import (
    COMMON_EFFECTS,
    addable_effects,
    effect_hint,
    effects_note,
    more_effects,
    why_fixed,
)
from flexviz.view.fit_charts import (
    convergence_charts,
    progress_text,
    staircase_chart,
    staircase_charts,
    staircase_html,
    sweep_bandwidths,
    sweep_charts,
    sweep_html,
)
from flexviz.view.identifiability import check_html, listed
from flexviz.view.next_step import next_step, steps_done
from flexviz.view.residual_maps import (
    MAP_COLUMNS,
    free_chart,
    free_html,
    leading_map,
    map_chart,
    map_charts,
    map_html,
    map_of,
    notable,
    spectrum_chart,
)
from flexviz.view.residual_samples import (
    VARIABLES,
    ResidualSamples,
    groups_html,
    range_html,
    stretches_of,
    time_residual,
)
from flexviz.view.status import (
    error_text,
    joint_colours,
    joint_rms,
    legend_html,
    status_html,
    step_line_html,
    total_rms,
)
from flexviz.view.tables import parameters_html, set_html, truth_html, truth_values
from flexviz.view.time_charts import (
    evidence_chart,
    numbers_html,
    observer_for,
    observer_numbers,
    signals_charts,
    states_charts,
)
from flexviz.view.verdict import finding_html, heading_html, verdict_html

__all__ = [
    "COMMON_EFFECTS",
    "MAP_COLUMNS",
    "VARIABLES",
    "ResidualSamples",
    "addable_effects",
    "card_html",
    "check_html",
    "convergence_charts",
    "effect_hint",
    "effects_note",
    "error_text",
    "evidence_chart",
    "finding_html",
    "free_chart",
    "free_html",
    "groups_html",
    "heading_html",
    "joint_colours",
    "joint_rms",
    "leading_map",
    "legend_html",
    "listed",
    "map_chart",
    "map_charts",
    "map_html",
    "map_of",
    "more_effects",
    "next_step",
    "notable",
    "numbers_html",
    "observer_for",
    "observer_numbers",
    "parameters_html",
    "progress_text",
    "range_html",
    "set_html",
    "signals_charts",
    "spectrum_chart",
    "staircase_chart",
    "staircase_charts",
    "staircase_html",
    "states_charts",
    "status_html",
    "step_line_html",
    "steps_done",
    "stretches_of",
    "sweep_bandwidths",
    "sweep_charts",
    "sweep_html",
    "time_residual",
    "total_rms",
    "truth_html",
    "truth_values",
    "verdict_html",
    "why_fixed",
]
