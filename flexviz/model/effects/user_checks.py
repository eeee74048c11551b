"""Checks of a user-defined effect; errors name its file and line."""

from __future__ import annotations

import ast
import re
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import get_args

import numpy as np

from flexviz.base.errors import InputError, choose_from, one_line
from flexviz.model.effects.effect import Effect
from flexviz.model.effects.law import LawEffect, LinearEffect
from flexviz.model.effects.terms import Array, EffectTarget, JointState, ParameterSpec, Terms, Where
from flexviz.model.effects.trial import TrialMotion, TrialSignal

SNAKE_CASE = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
TEXTS = ("title", "explanation", "equation", "signature", "confirm", "reference")
SCOPES = ("joint", "set", "payload")
TARGET = EffectTarget(joint=0, group="g1", payload="p1")
TRIAL = TrialMotion(
    np.linspace(0.0, 6.0, 3001),
    motor=TrialSignal(((0.6, 1.3, 0.2), (0.3, 3.1, 1.0)), constant=0.4),
    torque=TrialSignal(((40.0, 1.1, 0.5), (25.0, 4.3, 2.0)), constant=5.0),
    neighbour=TrialSignal(((0.5, 2.0, 0.3),)),
    stiffness=1500.0,
    motor_viscous=0.9,
)
SLOPE_TOLERANCE = 1e-3  # of the largest value: allowed difference from finite differences
MIN_AGREEING_SHARE = 0.99  # of the samples: kinks are allowed


@dataclass(frozen=True)
class EffectFile:
    """A user's effect file with the line numbers of its definitions."""

    file: Path  # as given by the user
    lines: Mapping[tuple[str, str], int] = field(default_factory=dict)  # (class, attribute or "") → line

    @staticmethod
    def read(file: Path) -> EffectFile:
        """Read a file's structure without running it."""
        if not file.is_file():
            raise InputError("does not exist" if not file.exists() else "is not a file", file=file)
        try:
            tree = ast.parse(file.read_bytes(), filename=str(file))
        except SyntaxError as error:
            raise InputError(f"{error.msg}", file=file, place=f"line {error.lineno}") from None
        except ValueError as error:
            raise InputError(f"is not a Python file ({error})", file=file) from None
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
        """An error about a class, with the line of the first of `names` that it defines."""
        owners = [(c.__name__, name) for name in (*names, "") for c in kind.__mro__]
        line = next((self.lines[place] for place in owners if place in self.lines), None)
        place = None if line is None else f"line {line}"
        return InputError(f"class {kind.__name__}: {one_line(message)}", file=self.file, place=place)

    @contextmanager
    def running(self, kind: type, method: str) -> Iterator[None]:
        """Turn exceptions of the file's code into one-line errors with its line."""
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


def check(kind: type[Effect], file: EffectFile, taken: Mapping[str, Effect]) -> Effect:
    """An instance of a user's class, or InputError with the line of the first check that it fails.

    `taken` are the loaded effects.
    """
    missing = sorted(getattr(kind, "__abstractmethods__", ()))
    if missing:
        raise file.error(f'method "{missing[0]}" is missing', kind)
    with file.running(kind, "__init__"):
        effect = kind()
    checks = _Checks(effect, file)
    checks.description(taken)
    checks.parameters()
    checks.law() if isinstance(effect, LawEffect) else checks.terms()
    checks.guesses()
    checks.simulation()
    return effect


class _Checks:
    """The checks of one effect along the trial motion."""

    def __init__(self, effect: Effect, file: EffectFile) -> None:
        self._effect, self._file = effect, file

    def fails(self, message: str, *names: str) -> InputError:
        """An error with the line of the first of `names` in the class."""
        return self._file.error(message, type(self._effect), *names)

    def running(self, method: str) -> AbstractContextManager[None]:
        """As `EffectFile.running`, for this effect."""
        return self._file.running(type(self._effect), method)

    def description(self, taken: Mapping[str, Effect]) -> None:
        effect = self._effect
        for attribute in ("name", *TEXTS, "where", "parameters"):
            if not hasattr(type(effect), attribute):
                raise self.fails(f'attribute "{attribute}" is missing')
        for attribute in ("name", *TEXTS):
            value = getattr(effect, attribute)
            if not isinstance(value, str) or not value.strip():
                raise self.fails(f"{attribute} is {value!r}, expected a text", attribute)
        if not SNAKE_CASE.fullmatch(effect.name):
            raise self.fails(f'name "{effect.name}" is not snake_case, as "cubic_friction" is', "name")
        if effect.name in taken:
            raise self.fails(f'name "{effect.name}" is taken by another effect', "name")
        choices = {"where": get_args(Where), "scope": SCOPES}
        choices |= {name: (None, *taken) for name in ("beside", "replaces")}
        for attribute, valid in choices.items():
            value = getattr(effect, attribute)
            if value not in valid:
                meant = choose_from(str(value), [v for v in valid if v is not None])
                raise self.fails(f'{attribute} "{value}": {meant}', attribute)
        if isinstance(effect, LawEffect) and effect.scope != "joint":
            raise self.fails(f'scope is "{effect.scope}", expected "joint" for a LawEffect', "scope")
        if isinstance(effect, LawEffect) and type(effect).gravity is not LawEffect.gravity:
            raise self.fails("gravity is for an Effect, a LawEffect has none", "gravity")

    def parameters(self) -> None:
        effect, specs = self._effect, self._effect.parameters
        if not isinstance(specs, tuple) or not specs or not all(isinstance(p, ParameterSpec) for p in specs):
            raise self.fails("parameters is not a tuple of ParameterSpec", "parameters")
        names = [p.name for p in specs]
        for p in specs:
            if not SNAKE_CASE.fullmatch(p.name) or names.count(p.name) > 1:
                raise self.fails(f'parameter "{p.name}" is not a unique snake_case name', "parameters")
            if not p.lower < p.upper:
                raise self.fails(f'parameter "{p.name}": its bounds leave no room', "parameters")
        if effect.example and len(effect.example) != len(specs):
            raise self.fails(f"example has {len(effect.example)} values, expected {len(specs)}", "example")
        for p, value in zip(specs, effect.sizes(), strict=True):
            if not (np.isfinite(value) and p.lower <= value <= p.upper):
                raise self.fails(f"example: {p.name} = {value:g} is out of its bounds", "example")
        for name in getattr(effect, "grid", {}):
            if name not in names:
                raise self.fails(f'grid "{name}": {choose_from(name, names)}', "grid")

    def law(self) -> None:
        """Shapes and slopes of the law, and `state` where u depends on identified quantities."""
        effect, motion = self._effect, TRIAL.motions(0)[0]
        assert isinstance(effect, LawEffect)
        method = "columns" if isinstance(effect, LinearEffect) else "law"
        count, width = len(motion.time), len(effect.parameters)

        def law(p: Array) -> tuple[Array, Array]:
            with self.running(method):
                if isinstance(effect, LinearEffect):
                    self.shapes(method, columns=(effect.columns(motion), (width, count)))
                u, slopes = effect.law(motion, p)
            self.shapes(method, u=(u, (count,)), slopes=(slopes, (width, count)))
            return np.asarray(u), np.asarray(slopes)

        self.slopes(law, method)
        other = replace(
            motion,
            torque=0.8 * motion.torque + 1.0,
            torque_scale=0.8 * motion.torque_scale,
            link_position=motion.link_position + 0.01,
            link_velocity=motion.link_velocity + 0.01,
            stiffness=1.2 * motion.stiffness,
            motor_viscous=1.2 * motion.motor_viscous,
        )
        values = effect.sizes()
        with self.running(method):
            moved = effect.law(other, values)[0]
        if not effect.state and not np.array_equal(law(values)[0], moved):
            what = "torque, link side, stiffness or viscous friction"
            raise self.fails(f"u depends on {what}: state = True is missing", "state", method)

    def terms(self) -> None:
        width = len(self._effect.parameters)

        def terms(p: Array) -> tuple[Array, Array]:
            with self.running("terms"):
                found = self._effect.terms(TRIAL, TARGET, p)
            if not isinstance(found, Terms):
                raise self.fails("terms does not return Terms", "terms")
            self.entry(found.entry, p)
            wanted = (1 if found.entry in ("residual", "gravity") else 3, TRIAL.count(), len(found.joints))
            self.shapes("terms", value=(found.value, wanted), slopes=(found.slopes, (width, *wanted)))
            return found.value[0].ravel(), found.slopes[:, 0].reshape(width, -1)

        self.slopes(terms, "terms")

    def entry(self, said: str, p: Array) -> None:
        """An effect that turns gravity, and no other, says so in its terms and in the property `entry`."""
        with self.running("gravity"):
            turns = self._effect.gravity(p, TRIAL.gravity()) is not None
        if turns != (said == "gravity") or turns != (self._effect.entry == "gravity"):
            own = self._effect.entry
            why = 'gravity(), the terms\' entry "gravity" and the property entry "gravity" belong together'
            raise self.fails(
                f'{why}; found the entries "{said}" and "{own}"', "gravity" if turns else "terms"
            )

    def shapes(self, method: str, **arrays: tuple[Array, tuple[int, ...]]) -> None:
        for name, (array, wanted) in arrays.items():
            if np.shape(array) != wanted:
                raise self.fails(f"{name} has shape {np.shape(array)}, expected {wanted}", method)

    def slopes(self, law: Callable[[Array], tuple[Array, Array]], method: str) -> None:
        """u and its slopes are finite, agree with finite differences, and are linear if declared so."""
        effect, values = self._effect, self._effect.sizes()
        u, slopes = law(values)
        if not (np.isfinite(u).all() and np.isfinite(slopes).all()):
            raise self.fails("u or its slopes are not finite numbers on a trial motion", method)
        for k, (spec, slope) in enumerate(zip(effect.parameters, slopes, strict=True)):
            step = 1e-5 * max(abs(values[k]), 1e-3)
            up, down = values.copy(), values.copy()
            up[k] += step
            down[k] -= step
            measured = (law(up)[0] - law(down)[0]) / (up[k] - down[k])
            rounding = 1e-14 * np.abs(u).max() / step
            if (worst := _difference(slope, measured, rounding)) is not None:
                what = f"∂u/∂{spec.name} differs from finite differences"
                raise self.fails(f"{what} by {100 * worst:.2g} % of its size", method)
        if effect.linear and not np.allclose(values @ slopes, u, rtol=1e-9, atol=1e-9 * np.abs(u).max()):
            raise self.fails("linear = True, but u is not linear in the parameters", "linear", method)

    def guesses(self) -> None:
        with self.running("guesses"):
            for guess in self._effect.guesses(TRIAL, TARGET):
                values = np.asarray(guess.to_values(np.zeros(len(guess.columns))), float)
                if values.shape != (len(self._effect.parameters),) or not np.isfinite(guess.columns).all():
                    raise self.fails("a guess lacks parameters or has columns that are not finite", "guesses")

    def simulation(self) -> None:
        """The simulated torque is the law's u along the trial motion."""
        effect, motion = self._effect, TRIAL.motions(0)[0]
        with self.running("simulation"):
            torque = effect.simulation(effect.sizes())
        if torque is None:
            return
        if not isinstance(effect, LawEffect) or effect.where not in ("motor", "link", "joint"):
            raise self.fails("only laws of motor, link or joint can be simulated", "simulation")
        motor, link = (motion.position, motion.velocity), (motion.link_position, motion.link_velocity)
        rows = np.stack((motion.time, *motor, *link, motion.torque), axis=1).tolist()
        with self.running("simulation"):
            found = np.array([float(torque(JointState(*row))) for row in rows])
        if effect.where == "joint":  # the joint then carries more; the law gives what q gains at that torque
            bend = motion.position - motion.link_position
            carried = motion.stiffness * bend + found
            found = carried / motion.stiffness - bend
            motion = replace(motion, torque=carried, torque_scale=float(np.sqrt(np.mean(carried**2))))
        with self.running("law"):
            u = effect.law(motion, effect.sizes())[0]
        if (worst := _difference(u, found)) is not None:
            what = f"simulation and u differ by {100 * worst:.2g} % of their size"
            raise self.fails(f"{what} along a trial motion", "simulation")


def _difference(one: Array, other: Array, rounding: float = 0.0) -> float | None:
    """The largest difference, relative to the larger array; None if nearly all samples agree."""
    size = max(np.abs(one).max(), np.abs(other).max())
    if np.mean(np.abs(one - other) <= SLOPE_TOLERANCE * size + rounding) >= MIN_AGREEING_SHARE:
        return None
    return float(np.abs(one - other).max() / size)
