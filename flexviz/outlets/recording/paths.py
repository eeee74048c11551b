"""The contents of a recording: entity paths and timelines.

    /about                                            text: the set and all results
    /log                                              text: one line per event
    /groups/<group>/about                             text: the group, how its model was simulated
    /groups/<group>/measured/<signal>/<joint>         as recorded: theta, tau, and q, tau_joint, theta_ref
    /groups/<group>/robots/<robot>/<body>             "measured" and "identified" in 3D; the newest result's
    /groups/<group>/robots/<robot>/joints/<joint>     where its child link's frame is in its parent link's
    /observers/<observer>/<group>/<state>/<joint>     theta_0 … theta_4, tau_0 … tau_2, disturbance
    /observers/<observer>/<group>/transients/<state>/<joint>   the same during start-up and end transients
    /results/<number>/about                           text: parameters, errors
    /results/<number>/json                            the same in the format of `identify --json`
    /results/<number>/groups/<group>/<signal>/<joint>       residual, torque, q of the equation
    /results/<number>/groups/<group>/simulated/<signal>/<joint>  the simulated model: theta, q, tau
    /results/<number>/optimiser/cost, step, stage, log10_cost, log10_step
    /results/<number>/optimiser/parameters/<parameter>/<joint>
    /results/<number>/estimates/<parameter>/<joint>   value and variance, unit, identifiable
    /results/<number>/optimiser/relative              all parameters, divided by their last values
    /results/<number>/optimiser/interval              both ends of their final 95 % intervals, likewise
    /diagnoses/<number>/verdict                       text: the verdict and the ranked findings
    /diagnoses/<number>/json                          the same in the format of `diagnose --json`
    /diagnoses/<number>/staircase, laws, free             pictures: errors step by step, laws, a free curve
    /results/<number>/map, curves/<joint>                 pictures: where this model fails
    /diagnoses/<number>/map, curves/<joint>               the same of a diagnosis' final model
    /diagnoses/<number>/evidence/<rank>/<group>/residual, signature

Every link of a robot is a named frame, <robot>/<group>/<link>; in merged recordings they begin with A/ or B/.

Groups are on the timeline `time` (each group's own time), the optimiser is on `iteration` and, so that its
views are never empty, also on `time` [s] since its start. Results and diagnoses count from 1.
"""

from __future__ import annotations

from collections.abc import Iterable
from hashlib import sha256
from typing import Any

import numpy as np
import rerun as rr

from flexviz.base.units import joint_units, unit_of_all
from flexviz.model.observers import Observer

TIME = "time"  # [s]
ITERATION = "iteration"
APPLICATION = "flexviz"

DISTURBANCE = "disturbance"
TITLES = {
    "theta_0": "θ [rad]",
    "theta_1": "dθ/dt [rad/s]",
    "theta_2": "d²θ/dt² [rad/s²]",
    "theta_3": "d³θ/dt³ [rad/s³]",
    "theta_4": "d⁴θ/dt⁴ [rad/s⁴]",
    "tau_0": "τ [Nm]",
    "tau_1": "dτ/dt [Nm/s]",
    "tau_2": "d²τ/dt² [Nm/s²]",
    DISTURBANCE: "disturbance [rad/s⁵]",
}
STATES = tuple(name for name in TITLES if name != DISTURBANCE)  # of every observer

ABOUT = "/about"
LOG = "/log"


def titled(text: str, slides: Iterable[Any]) -> str:
    """A title "θ [rad]" for joints that slide or turn, (n,): "θ [m, rad]"."""
    head, _, unit = text.removesuffix("]").partition(" [")
    return f"{head} [{unit_of_all(joint_units(unit, slides), unit)}]"


def path(*parts: object) -> str:
    """An entity path; special characters in the parts are escaped."""
    return rr.new_entity_path([str(part) for part in parts])


def observer_name(observer: Observer) -> str:
    """Observer name, bandwidth (one or one per joint) and a hash of gains set by hand: "eso-40-60"."""
    own = [f"gains-{sha256(repr(observer.gains).encode()).hexdigest()[:6]}"] if observer.gains else []
    return "-".join([observer.name, *(f"{w:.6g}" for w in np.atleast_1d(observer.bandwidth)), *own])


def estimate_path(number: int, name: str) -> str:
    """The entity of the value and variance of a result's parameter "stiffness:joint1"."""
    parameter, _, joint = name.partition(":")
    return path("results", number, "estimates", parameter, *([joint] if joint else []))


def parameter_path(number: int, name: str) -> str:
    """The entity of a result's parameter "stiffness:joint1"."""
    parameter, _, joint = name.partition(":")
    return path("results", number, "optimiser", "parameters", parameter, *([joint] if joint else []))
