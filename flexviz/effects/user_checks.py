"""Checks of a user-defined effect; errors name its file and line."""

from __future__ import annotations

import ast
import re
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast, get_args

import numpy as np

from flexviz.effects.effect import Effect
from flexviz.effects.law import LawEffect, LinearEffect
from flexviz.effects.terms import Array, EffectTarget, Instant, ParameterSpec, Terms, Where
from flexviz.effects.trial import TrialMotion, TrialSignal
from flexviz.errors import InputError, choose_from, one_line

SNAKE_CASE = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
TEXTS = ("title", "explanation", "equation", "signature", "confirm", "reference")
SCOPES = ("joint", "set", "payload")
PLACE = EffectTarget(joint=0, group="g1", payload="p1")
TRIAL = TrialMotion(
    np.linspace(0.0, 6.0, 3001),
    motor=TrialSignal(((0.6, 1.3, 0.2), (0.3, 3.1, 1.0)), constant=0.4),
    torque=TrialSignal(((40.0, 1.1, 0.5), (25.0, 4.3, 2.0)), constant=5.0),
    neighbour=TrialSignal(((0.5, 2.0, 0.3),)),
    stiffness=1500.0,
    motor_viscous=0.9,
)
TOLERANCE = 1e-3  # of the largest value: how well derivatives have to agree with finite differences
AGREEING_SHARE = 0.99  # of the samples: a kink in between is allowed


@dataclass(frozen=True)
class EffectFile:
    """An effect file and where things stand in it.

    Attributes:
        file: as the user named it.
        lines: (class, name in it or "") → line.
    """

    file: Path
    lines: Mapping[tuple[str, str], int] = field(default_factory=dict)

    @staticmethod
    def read(file: Path) -> EffectFile:
        """Read a file's structure without running it."""
        if not file.is_file():
            raise InputError("does not exist" if not file.exists() else "is no file", file=file)
        try:
            tree = ast.parse(file.read_bytes(), filename=str(file))
        except SyntaxError as error:
            raise InputError(f"{error.msg}", file=file, place=f"line {error.lineno}") from None
        except ValueError as error:
            raise InputError(f"is no Python file ({error})", file=file) from None
        lines: dict[tuple[str, str], int] = {}
        for node in tree.body:
            if not isinstance(node, ast.ClassDef):
                continue
            lines[node.name, ""] = node.lineno
            for part in node.body:
                targets = part.targets if isinstance(part, ast.Assign) else [getattr(part, "target", None)]
                for target in targets:
                    if isinstance(target, ast.Name):
                        lines[node.name, target.id] = part.lineno
                if isinstance(part, ast.FunctionDef):
                    lines[node.name, part.name] = part.lineno
        return EffectFile(file, lines)

    def error(self, message: str, kind: type, *names: str) -> InputError:
        """What is wrong with a class, at the line of the first of `names` that stands in it."""
        owners = [(c.__name__, name) for name in (*names, "") for c in kind.__mro__]
        line = next((self.lines[place] for place in owners if place in self.lines), None)
        place = None if line is None else f"line {line}"
        return InputError(f"class {kind.__name__}: {one_line(message)}", file=self.file, place=place)

    @contextmanager
    def running(self, kind: type, method: str) -> Iterator[None]:
        """Errors raised by the file's own code, as errors at that line."""
        try:
            with np.errstate(all="ignore"):
                yield
        except InputError:
            raise
        except Exception as error:
            frames = traceback.extract_tb(error.__traceback__)
            lines = [f.lineno for f in frames if f.filename == str(self.file.resolve())]
            message = f"class {kind.__name__}: {method} raises {type(error).__name__}: {error}"
            if not lines:
                raise self.error(f"{method} raises {type(error).__name__}: {error}", kind, method) from None
            raise InputError(one_line(message), file=self.file, place=f"line {lines[-1]}") from None


def check(kind: type[Effect], source: EffectFile, taken: Mapping[str, Effect]) -> Effect:
    """The effect of a class, if everything about it is right.

    Args:
        kind: the class.
        source: where it stands.
        taken: the effects there are.
    """
    missing = sorted(getattr(kind, "__abstractmethods__", ()))
    if missing:
        raise source.error(f'method "{missing[0]}" is missing', kind)
    with source.running(kind, "__init__"):
        effect = kind()
    _described(effect, source, taken)
    _parameters(effect, source)
    values = effect.sizes()
    if isinstance(effect, LawEffect):
        _law(effect, values, source)
    else:
        _terms(effect, values, source)
    _guesses(effect, source)
    _simulation(effect, values, source)
    return effect


def _described(effect: Effect, source: EffectFile, taken: Mapping[str, Effect]) -> None:
    kind = type(effect)
    for attribute in ("name", *TEXTS, "where", "parameters"):
        if not hasattr(kind, attribute):
            raise source.error(f'attribute "{attribute}" is missing', kind)
    for attribute in ("name", *TEXTS):
        value = getattr(effect, attribute)
        if not isinstance(value, str) or not value.strip():
            raise source.error(f"{attribute} is {value!r}, a text would be right", kind, attribute)
    if not SNAKE_CASE.fullmatch(effect.name):
        raise source.error(f'name "{effect.name}" is not snake_case, as "cubic_friction" is', kind, "name")
    if effect.name in taken:
        raise source.error(f'name "{effect.name}" is taken by another effect', kind, "name")
    for attribute, valid in (("where", get_args(Where)), ("scope", SCOPES)):
        value = getattr(effect, attribute)
        if value not in valid:
            raise source.error(f'{attribute} "{value}": {choose_from(str(value), valid)}', kind, attribute)
    if isinstance(effect, LawEffect) and effect.scope != "joint":
        raise source.error('a law of a joint\'s motion has scope "joint"', kind, "scope")
    for attribute in ("beside", "replaces"):
        other = getattr(effect, attribute)
        if other is not None and other not in taken:
            raise source.error(f'{attribute} "{other}": {choose_from(str(other), taken)}', kind, attribute)


def _parameters(effect: Effect, source: EffectFile) -> None:
    kind, specs = type(effect), effect.parameters
    if not isinstance(specs, tuple) or not specs or not all(isinstance(p, ParameterSpec) for p in specs):
        raise source.error("parameters is not a tuple of ParameterSpec", kind, "parameters")
    names = [p.name for p in specs]
    for p in specs:
        if not SNAKE_CASE.fullmatch(p.name) or names.count(p.name) > 1:
            raise source.error(
                f'parameter "{p.name}" is not a snake_case name of its own', kind, "parameters"
            )
        if not p.lower < p.upper:
            raise source.error(f'parameter "{p.name}": its bounds leave no room', kind, "parameters")
    example = effect.example
    if example and len(example) != len(specs):
        raise source.error(f"example has {len(example)} values for {len(specs)} parameters", kind, "example")
    for p, value in zip(specs, effect.sizes(), strict=True):
        if not (np.isfinite(value) and p.lower <= value <= p.upper):
            raise source.error(f"example: {p.name} = {value:g} is out of its bounds", kind, "example")
    for name in getattr(effect, "grid", {}):
        if name not in names:
            raise source.error(f'grid "{name}": {choose_from(name, names)}', kind, "grid")


def _law(effect: LawEffect, values: Array, source: EffectFile) -> None:
    kind, motion = type(effect), TRIAL.motions(0)[0]
    method = "columns" if isinstance(effect, LinearEffect) else "law"
    count, width = len(motion.time), len(values)

    def law(p: Array) -> tuple[Array, Array]:
        with source.running(kind, method):
            if isinstance(effect, LinearEffect):
                columns = np.asarray(effect.columns(motion))
                if columns.shape != (width, count):
                    wanted = f"({width}, {count}) (parameters, samples)"
                    raise source.error(f"columns has shape {columns.shape}, {wanted} is right", kind, method)
            u, slopes = (np.asarray(part) for part in effect.law(motion, p))
        if u.shape != (count,) or slopes.shape != (width, count):
            wanted = f"({count},) and ({width}, {count}) are right"
            raise source.error(
                f"u and slopes have shapes {u.shape} and {slopes.shape}, {wanted}", kind, method
            )
        return u, slopes

    _derivatives(effect, values, law, source, method)
    other = replace(
        motion,
        torque=0.8 * motion.torque + 1.0,
        torque_scale=0.8 * motion.torque_scale,
        link_position=motion.link_position + 0.01,
        link_velocity=motion.link_velocity + 0.01,
        stiffness=1.2 * motion.stiffness,
        motor_viscous=1.2 * motion.motor_viscous,
    )
    with source.running(kind, method):
        moved = effect.law(other, values)[0]
    if not effect.state and not np.array_equal(law(values)[0], moved):
        what = "torque, link side, stiffness or viscous friction"
        raise source.error(f"u depends on {what}: state = True is missing", kind, "state", method)


def _terms(effect: Effect, values: Array, source: EffectFile) -> None:
    kind, width = type(effect), len(values)

    def terms(p: Array) -> tuple[Array, Array]:
        with source.running(kind, "terms"):
            found = effect.terms(TRIAL, PLACE, p)
        if not isinstance(found, Terms):
            raise source.error("terms gives no Terms", kind, "terms")
        wanted = (1 if found.entry == "residual" else 3, TRIAL.count(), len(found.joints))
        if found.value.shape != wanted or found.slopes.shape != (width, *wanted):
            shapes = f"{found.value.shape} and {found.slopes.shape}"
            right = f"{wanted} and {(width, *wanted)} are right"
            raise source.error(f"value and slopes have shapes {shapes}, {right}", kind, "terms")
        return found.value[0].ravel(), found.slopes[:, 0].reshape(width, -1)

    _derivatives(effect, values, terms, source, "terms")


def _derivatives(
    effect: Effect,
    values: Array,
    law: Callable[[Array], tuple[Array, Array]],
    source: EffectFile,
    method: str,
) -> None:
    """u and its slopes are numbers, agree with finite differences, and are linear where that is said."""
    kind = type(effect)
    u, slopes = law(values)
    if not (np.isfinite(u).all() and np.isfinite(slopes).all()):
        raise source.error("u or its slopes are not finite numbers on a trial motion", kind, method)
    for k, (spec, slope) in enumerate(zip(effect.parameters, slopes, strict=True)):
        step = 1e-5 * max(abs(values[k]), 1e-3)
        up, down = values.copy(), values.copy()
        up[k] += step
        down[k] -= step
        measured = (law(up)[0] - law(down)[0]) / (up[k] - down[k])
        size = max(np.abs(slope).max(), np.abs(measured).max())
        rounding = 1e-14 * np.abs(u).max() / step
        if np.mean(np.abs(slope - measured) <= TOLERANCE * size + rounding) < AGREEING_SHARE:
            worst = float(np.abs(slope - measured).max() / size)
            message = f"∂u/∂{spec.name} differs from finite differences by {100 * worst:.2g} % of its size"
            raise source.error(message, kind, method)
    if effect.linear and not np.allclose(values @ slopes, u, rtol=1e-9, atol=1e-9 * np.abs(u).max()):
        raise source.error("linear = True, but u is not linear in the parameters", kind, "linear", method)


def _guesses(effect: Effect, source: EffectFile) -> None:
    kind = type(effect)
    with source.running(kind, "guesses"):
        for guess in effect.guesses(TRIAL, PLACE):
            values = np.asarray(guess.to_values(np.zeros(len(guess.columns))), float)
            if values.shape != (len(effect.parameters),) or not np.isfinite(guess.columns).all():
                raise source.error("a guess has not its parameters or no finite columns", kind, "guesses")


def _simulation(effect: Effect, values: Array, source: EffectFile) -> None:
    """Its torque is the law's u along the trial motion."""
    kind = type(effect)
    with source.running(kind, "simulation"):
        torque = effect.simulation(values)
    if torque is None:
        return
    if not isinstance(effect, LawEffect) or effect.where not in ("motor", "link", "joint"):
        raise source.error("only laws of motor, link or joint can be simulated", kind, "simulation")
    motion = TRIAL.motions(0)[0]
    load = motion.torque
    rows: list[tuple[Any, ...]] = list(
        zip(
            motion.time.tolist(), motion.position.tolist(), motion.velocity.tolist(),
            motion.link_position.tolist(), motion.link_velocity.tolist(), load.tolist(), strict=True,
        )
    )  # fmt: skip
    names = ("time", "theta", "theta_velocity", "q", "q_velocity", "load")
    with source.running(kind, "simulation"):
        found = np.array(
            [
                float(torque(cast(Instant, SimpleNamespace(**dict(zip(names, row, strict=True))))))
                for row in rows
            ]
        )
    if effect.where == "joint":  # the joint then carries more, and the law says what q gains at that torque
        bend = motion.position - motion.link_position
        carried = motion.stiffness * bend + found
        found = carried / motion.stiffness - bend
        motion = replace(motion, torque=carried, torque_scale=float(np.sqrt(np.mean(carried**2))))
    with source.running(kind, "law"):
        u = effect.law(motion, values)[0]
    size = max(np.abs(u).max(), np.abs(found).max())
    if np.mean(np.abs(u - found) <= TOLERANCE * size) < AGREEING_SHARE:
        worst = float(np.abs(u - found).max() / size)
        message = f"simulation and u differ by {100 * worst:.2g} % of their size along a trial motion"
        raise source.error(message, kind, "simulation")
