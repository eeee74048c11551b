"""Charts, tables and sentences of results as plain data, for app, report and recording; no browser code."""

from flexviz.content.results import evidence_chart, law_chart, law_difference, staircase_chart
from flexviz.content.view.effect_matrix import joint_effects, joints_with, matrix_html, with_joints
from flexviz.content.view.effects import (
    COMMON_EFFECTS,
    SERVO_KIND,
    SERVO_ONLY,
    addable_effects,
    by_title,
    card_html,
    effect_hint,
    effects_note,
    more_effects,
    so_far_html,
    suits,
    why_fixed,
)
from flexviz.content.view.fit_charts import (
    convergence_charts,
    falling_cost,
    progress_text,
    solver_stages,
    sweep_bandwidths,
    sweep_charts,
    sweep_html,
)
from flexviz.content.view.free_curves import (
    free_chart,
    free_html,
    model_curve_charts,
    offered_curve,
    physical,
)
from flexviz.content.view.law_charts import law_charts
from flexviz.content.view.link_colours import LinkColours, joints_html, legend_html, link_colours
from flexviz.content.view.own_robot import (
    OWN_SIGNALS,
    known_scales,
    own_columns_html,
    own_files_html,
    own_runs_html,
    own_state_html,
    remedy_text,
    shown_signals,
)
from flexviz.content.view.poles import pole_at, poles_html
from flexviz.content.view.residual_time import BEFORE, RESIDUAL, BeforeAfter, time_residual
from flexviz.content.view.residuals import (
    MAP_COLUMNS,
    VARIABLES,
    ResidualSamples,
    groups_html,
    leading_map,
    map_chart,
    map_charts,
    map_of,
    notable,
    range_html,
    spectrum_chart,
    stretches_of,
)
from flexviz.content.view.searching import alone_html, search_charts, worst_joint_so_far
from flexviz.content.view.shape_charts import shape_charts
from flexviz.content.view.staircase import (
    StaircaseRun,
    model_name,
    model_runs,
    name_with_error,
    run_name,
    staircase_charts,
    staircase_html,
)
from flexviz.content.view.status import (
    OF_EARLIER,
    error_text,
    next_step,
    shown_errors,
    stated_error,
    status_html,
    step_line_html,
    steps_done,
    worst_joint,
    wrong_html,
)
from flexviz.content.view.time_charts import (
    numbers_html,
    observer_for,
    signal_residual,
    signals_charts,
    states_charts,
    stretch,
)
from flexviz.content.view.torque_fit import torque_fit_charts
from flexviz.content.view.truth import Truth, truth_values
from flexviz.content.view.tuning import Cost, residuals_html, trade_chart
