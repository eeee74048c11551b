"""Where things lie in a recording: entity paths and timelines.

    /summary                                     text: the result
    /groups/<group>/about                        text: what the group is, how it was simulated
    /groups/<group>/measured/<signal>/<joint>    as recorded: theta, tau, and q, tau_joint, theta_ref if there
    /groups/<group>/states/<state>/<joint>       the observer's: theta_0 … theta_4, tau_0 … tau_2, disturbance
    /groups/<group>/transients/<state>/<joint>   the same, within the start-up and end transients
    /groups/<group>/identified/<signal>/<joint>  the simulated identified model: theta, q, tau
    /groups/<group>/identification/<signal>/<joint>   the equation's residual, transmission torque, link q
    /groups/<group>/robots/<robot>/<body>        "measured" and "identified" in 3D
    /optimiser/cost, /optimiser/step, /optimiser/stage, /optimiser/parameters/<parameter>/<joint>,
    /optimiser/relative/<parameter>/<joint>      each parameter divided by its last value

Groups are on the timeline `time` (each group's own time), the optimiser is on `iteration` and, so that its
views are never empty, also on `time` (seconds since it started).
"""

from __future__ import annotations

import rerun as rr

TIME = "time"  # [s]
ITERATION = "iteration"
APPLICATION = "flexviz"

THETA_STATES = ("theta_0", "theta_1", "theta_2", "theta_3", "theta_4")
TAU_STATES = ("tau_0", "tau_1", "tau_2")
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
    "disturbance": "disturbance [rad/s⁵]",
    "residual": "residual [Nm]",
    "torque": "transmission torque s [Nm]",
}

SUMMARY = "/summary"
OPTIMISER = "/optimiser"


def path(*parts: str) -> str:
    """An entity path; the parts may hold any characters."""
    return rr.new_entity_path(list(parts))


def group_path(group: str, *parts: str) -> str:
    """An entity path of one group."""
    return path("groups", group, *parts)


def parameter_path(kind: str, name: str) -> str:
    """The entity of a parameter called "stiffness:joint1"; `kind` is "parameters" or "relative"."""
    parameter, _, joint = name.partition(":")
    return path("optimiser", kind, parameter, *([joint] if joint else []))
