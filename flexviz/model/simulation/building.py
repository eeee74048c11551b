"""Building a plant from a robot and a FlexibleModel: inertias, payload, gravity and effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flexviz.base.errors import InputError, choose_from
from flexviz.base.facts import Fact
from flexviz.model.effects import EFFECTS
from flexviz.model.simulation.effect_laws import LAWS, Assembly, TorquePath
from flexviz.model.simulation.laws import ROOM_TEMPERATURE, UserEffectLaw
from flexviz.model.simulation.plant import Array, Plant
from flexviz.robot.model import EffectValue, FlexibleModel
from flexviz.robot.robot import PayloadBody, Robot


def make_plant(
    robot: Robot,
    model: FlexibleModel,
    payload: Sequence[PayloadBody] = (),
    *,
    group: str | None = None,
    payload_name: str | None = None,
    temperature: Sequence[float] | Array | None = None,
) -> tuple[Plant, TorquePath]:
    """The plant of `robot` with the parameters and effects of `model`, in Pinocchio's joint order.

    An effect with a group or a payload acts only if it is `group` or `payload_name`. `temperature` (n,) [°C]
    is the joints'; None: 20 °C.
    """
    if model.joints != robot.joints:
        raise InputError(f"the model's joints {model.joints} are not the robot's {robot.joints}")
    plant = Plant(
        None,
        robot.to_pin(model.stiffness),
        np.diag(robot.to_pin(model.motor_inertia)),
        robot.to_pin(model.link_viscous_friction),
        robot.to_pin(model.motor_viscous_friction),
    )
    degrees = np.full(robot.n, ROOM_TEMPERATURE) if temperature is None else np.asarray(temperature, float)
    path = TorquePath(np.zeros(robot.n), np.zeros(robot.n), np.full(robot.n, np.inf))
    made = Assembly(robot, plant, tuple(payload), robot.gravity, path, robot.to_pin(degrees))
    for effect in model.effects:
        if effect.group not in (None, group) or effect.payload not in (None, payload_name):
            continue
        check_effect(effect, robot.joints)
        named = robot.joints if effect.joint is None else (effect.joint,)
        joints = [int(robot.order[robot.joints.index(joint)]) for joint in named]
        if effect.effect in LAWS:
            LAWS[effect.effect].enter(made, joints, effect.parameters)
        else:
            law = UserEffectLaw.of(EFFECTS[effect.effect], effect.parameters)
            plant.extra += [(i, law) for i in joints]
    plant.model = robot.model_with(model.inertial, made.bodies, made.gravity)
    return plant, path


def is_simulated(name: str) -> bool:
    """Whether the effect can be simulated, by the library's or a user-defined law."""
    return name in LAWS or (name in EFFECTS and EFFECTS[name].simulation(EFFECTS[name].sizes()) is not None)


def simulated_effects() -> tuple[str, ...]:
    """The effects that can be injected."""
    return tuple(name for name in EFFECTS if is_simulated(name))


def require_simulated(name: str, what: str = "simulated") -> None:
    """InputError for an effect that does not exist, or that cannot be `what`."""
    if not is_simulated(name):
        if name in EFFECTS:
            raise InputError(f'effect "{name}" cannot be {what}: its class has no simulation')
        raise InputError(f'effect "{name}" does not exist; {choose_from(name, simulated_effects(), 30)}')


def without_unsimulated(model: FlexibleModel) -> tuple[FlexibleModel, list[Fact]]:
    """The model without user-defined effects whose class has no simulation, and a fact on each."""
    left = dict.fromkeys(
        e.effect for e in model.effects if e.effect in EFFECTS and not is_simulated(e.effect)
    )
    kept = tuple(e for e in model.effects if e.effect not in left)
    return replace(model, effects=kept), [Fact("not-simulated", "odd", values={"effect": e}) for e in left]


def check_effect(effect: EffectValue, joints: Sequence[str]) -> None:
    """InputError when the effect, its joint or one of its parameters does not exist."""
    name = effect.effect
    require_simulated(name)
    if effect.joint is not None and effect.joint not in joints:
        valid = choose_from(effect.joint, joints)
        raise InputError(f'effect {name}: joint "{effect.joint}" does not exist; {valid}')
    units = EFFECTS[name].units
    for key in effect.parameters:
        if key not in units:
            raise InputError(f'effect {name}: no parameter "{key}"; {choose_from(key, units)}')
    for key in units:
        if key not in effect.parameters:
            raise InputError(f'effect {name}: parameter "{key}" is missing')
