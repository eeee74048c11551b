"""Physical effects beyond the base model: library, user-defined effects, and the selection for a model."""

from flexviz.model.effects.curve_forms import CurveForm, curve_points, simple_form
from flexviz.model.effects.decoys import DECOYS
from flexviz.model.effects.effect import Effect, EffectEvidence, HiddenStart, JointScale
from flexviz.model.effects.free_curve import CURVES, FreeCurveEffect, free_curve
from flexviz.model.effects.free_curve import DIRECTIONS as FREE_CURVE_DIRECTIONS
from flexviz.model.effects.law import LawEffect, LinearEffect, LoadedEffect
from flexviz.model.effects.names import (
    EFFECT_FAMILIES,
    EFFECT_NAMES,
    GOAL_EFFECT_NAMES,
    family_of,
    is_user_defined,
    kin,
    known_names,
)
from flexviz.model.effects.registry import EFFECTS
from flexviz.model.effects.selection import ChosenEffect, choose_effects, everywhere, named_effect
from flexviz.model.effects.targets import STEPPED, LeftOut, ServoTargets, Written
from flexviz.model.effects.terms import (
    SIGN_VELOCITY,
    Context,
    EffectTarget,
    Entry,
    Guess,
    JointMotion,
    JointState,
    ParameterSpec,
    Terms,
    neighbour,
    smooth_sign,
)
from flexviz.model.effects.user_effects import forget_effects, load_effects, loaded_files

__all__ = [
    "CURVES",
    "DECOYS",
    "EFFECTS",
    "EFFECT_FAMILIES",
    "EFFECT_NAMES",
    "FREE_CURVE_DIRECTIONS",
    "GOAL_EFFECT_NAMES",
    "SIGN_VELOCITY",
    "STEPPED",
    "ChosenEffect",
    "Context",
    "CurveForm",
    "Effect",
    "EffectEvidence",
    "EffectTarget",
    "Entry",
    "FreeCurveEffect",
    "Guess",
    "HiddenStart",
    "JointMotion",
    "JointScale",
    "JointState",
    "LawEffect",
    "LeftOut",
    "LinearEffect",
    "LoadedEffect",
    "ParameterSpec",
    "ServoTargets",
    "Terms",
    "Written",
    "choose_effects",
    "curve_points",
    "everywhere",
    "family_of",
    "forget_effects",
    "free_curve",
    "is_user_defined",
    "kin",
    "known_names",
    "load_effects",
    "loaded_files",
    "named_effect",
    "neighbour",
    "simple_form",
    "smooth_sign",
]
