"""User-defined effects: effect classes from a Python file, checked and added to the library.

The file is executed with the rights of the user: load only trusted files. Only files named by the user are
loaded; sessions and measurement sets contain names of effects only.
"""

from __future__ import annotations

import hashlib
import importlib.util
import sys
import traceback
from importlib.machinery import ModuleSpec, SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType

from flexviz.base.errors import InputError, one_line
from flexviz.base.jobs import forget_in_children, in_children
from flexviz.model.effects.effect import Effect
from flexviz.model.effects.names import USER_NAMES
from flexviz.model.effects.registry import EFFECTS, effect_classes
from flexviz.model.effects.user_checks import EffectFile, check

_loaded: dict[Path, tuple[Effect, ...]] = {}


def load_effects(path: str | Path) -> tuple[Effect, ...]:
    """Run a trusted Python file and add its effect classes to the library, in this process and its workers.

    A loaded file is not run again.

    Raises:
        InputError: the file or one of its effects is invalid; with file and line.
    """
    file = Path(path)
    key = file.resolve()
    if key in _loaded:
        return _loaded[key]
    source = EffectFile.read(file)
    module = _run(file, key)
    try:
        effects = [check(c, source, EFFECTS) for c in effect_classes(module)]
        if not effects:
            raise InputError(
                "defines no effect, expected a class derived from flexviz.model.effects.LinearEffect",
                file=file,
            )
        names = [e.name for e in effects]
        for effect in effects:
            if names.count(effect.name) > 1:
                raise source.error(f'two effects are called "{effect.name}"', type(effect), "name")
    except BaseException:
        sys.modules.pop(module.__name__, None)
        raise
    _loaded[key] = tuple(effects)
    for effect in effects:
        EFFECTS[effect.name] = effect
        USER_NAMES.append(effect.name)
    in_children(load_effects, str(key))
    return _loaded[key]


def loaded_files() -> tuple[Path, ...]:
    """The loaded effect files, in loading order."""

    return tuple(_loaded)


def forget_effects() -> None:
    """Remove all user-defined effects from the library."""
    for name in USER_NAMES:
        EFFECTS.pop(name, None)
    for file in _loaded:
        forget_in_children(load_effects, str(file))
    USER_NAMES.clear()
    _loaded.clear()


class _AsItIsNow(SourceFileLoader):
    """Compiles the file itself: what is cached beside it counts as new for a second after a change."""

    def get_code(self, fullname: str) -> CodeType:
        return self.source_to_code(self.get_data(self.path), self.path)


def _run(file: Path, key: Path) -> ModuleType:
    name = f"flexviz_user_effects_{hashlib.sha256(str(key).encode()).hexdigest()[:12]}"
    if key.suffix != ".py":
        raise InputError("is not a Python file; its name has to end in .py", file=file)
    loader = _AsItIsNow(name, str(key))
    module = importlib.util.module_from_spec(ModuleSpec(name, loader, origin=str(key)))
    sys.modules[name] = module  # dataclasses look their module up there
    try:
        loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == str(key)]
        place = f"line {lines[-1]}" if lines else None
        raise InputError(one_line(f"{type(error).__name__}: {error}"), file=file, place=place) from None
    return module
