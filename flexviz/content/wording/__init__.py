"""Text for numbers, effects and findings, shared by app, report, recording and command line."""

import flexviz.content.wording.issue_kinds
import flexviz.content.wording.sample_kinds  # register what is said of issues
from flexviz.base.spelling import listed, number, plural
from flexviz.content.wording.effects import (
    SCOPES,
    bounds_text,
    effect_json,
    enters_text,
    parameter_text,
    relation_text,
    simulated_text,
)
from flexviz.content.wording.errors import (
    SAID_AS_SHARES,
    error_hover,
    error_in_torque,
    error_short,
    error_text,
    error_whole,
    explained,
    left_text,
    noise_text,
    percent,
)
from flexviz.content.wording.estimates import (
    NOT_DETERMINED,
    determined,
    estimate_cells,
    estimate_mark,
    estimate_words,
    interval_words,
    told,
)
from flexviz.content.wording.facts import fact_text
from flexviz.content.wording.findings import (
    ALONG,
    FAMILY_TITLES,
    UNTOLD,
    absorbed_list,
    capitalised,
    confidence_of,
    curve_text,
    effect_text_name,
    effect_title,
    family_title,
    finding_name,
    finding_title,
    kinds_text,
    lower,
    member_name,
    moved,
    share_text,
    tie_text,
    tied_family,
    value_text,
    values_text,
    where_text,
)
from flexviz.content.wording.glossary import GLOSSARY, Term, with_terms
from flexviz.content.wording.issues import general, issue_message, issue_text, keys_text
from flexviz.content.wording.law_axes import law_axes
from flexviz.content.wording.merging import (
    LIKELY,
    Families,
    MergedFinding,
    added_families,
    confidence_range,
    joint_score,
    joints_text,
    merged_findings,
    merged_texts,
    removes_text,
    text_names,
    text_runs,
    tied_families,
)
from flexviz.content.wording.mounting import mounting_text
from flexviz.content.wording.numbers import (
    MARKS,
    SYMBOLS,
    as_markdown,
    escape,
    interval,
    markdown_table,
    measured,
    measured_parts,
    plain_name,
    quantity,
    short_names,
    si_scale,
    sliding_note,
    temperature_text,
    unit_text,
)
from flexviz.content.wording.signals import TORQUE_SIGNAL, DrivingSignal, driving_signal
from flexviz.content.wording.topics.searching import separating_motion
from flexviz.content.wording.trace import TRACE_TITLE, decoys_text, told_moves
from flexviz.content.wording.verdicts import (
    MOST_NAMED,
    limit_text,
    location,
    span_text,
    verdict_text,
    what_stays,
)
