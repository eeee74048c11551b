"""Every effect of the library in every export format: written and checked, or left out for a reason."""

from __future__ import annotations

from pathlib import Path

import pytest

from flexviz.base.errors import InputError
from flexviz.model.effects import EFFECT_NAMES, EFFECTS
from flexviz.outlets.exporting import FORMATS, LeftOut, Written, coverage
from flexviz.outlets.exporting.coverage import REGISTRIES, PerJoint, PerRow
from tests.exporting_cases import identified, plan, short_set
from tests.model import test_compensation
from tests.outlets import test_export_code, test_export_robot


def names(target: str, kind: type[Written] | type[LeftOut]) -> set[str]:
    """The library's effects of which a format has an entry of this kind."""
    return {
        effect
        for (effect, at), entry in coverage().items()
        if at == target and effect in EFFECT_NAMES and isinstance(entry, kind)
    }


def test_every_effect_has_an_entry_in_every_format() -> None:
    found = coverage()
    assert set(found) == {(effect, target) for effect in EFFECTS for target in FORMATS}
    missing = [pair for pair, entry in found.items() if entry is None]
    assert not missing, f"flexviz/outlets/exporting/coverage.py: no entry for {missing}"
    assert all(set(registry) == set(EFFECT_NAMES) for registry in REGISTRIES.values())


def test_whatever_is_left_out_has_a_reason() -> None:
    for pair, entry in coverage().items():
        text = entry.because if isinstance(entry, LeftOut) else entry.meaning if entry else ""
        assert len(text) > 5 and not text.endswith("."), pair


@pytest.mark.parametrize("target", FORMATS)
def test_whatever_is_written_is_checked(target: str) -> None:
    """Each format's tests list the effects that they compare with the product's own laws."""
    checked = {
        "c": test_export_code.CHECKED,
        "python": test_export_code.CHECKED,
        "urdf": test_export_robot.URDF_CHECKED,
        "mjcf": test_export_robot.MJCF_CHECKED,
        "yaml": EFFECT_NAMES,  # test_export.test_every_effect_comes_back
        "json": EFFECT_NAMES,
        "table": test_compensation.CHECKED,
    }
    assert names(target, Written) == set(checked[target])


def test_an_effect_without_an_entry_is_found(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for registry in {id(r): r for r in REGISTRIES.values()}.values():
        monkeypatch.delitem(registry, "torque_ripple")
    undecided = {target for (_, target), entry in coverage().items() if entry is None}
    assert undecided == {"urdf", "mjcf", "c", "python", "table"}
    made = identified(short_set("planar-2r", tmp_path), plan("planar-2r", "torque_ripple:joint1").model)
    for target in undecided:
        assert FORMATS[target](made).left_out == ["torque_ripple:joint1: no export is registered for it"]


def test_numbers_of_the_code_are_parameters_of_the_effect() -> None:
    for effect, code in REGISTRIES["c"].items():
        known = [p.name for p in EFFECTS[effect].parameters]
        if isinstance(code, PerRow):
            assert list(code.columns) == known
        elif isinstance(code, PerJoint):
            assert code.parameter in known


@pytest.mark.parametrize("target, template", [("c", "template.c"), ("python", "template.py")])
def test_a_table_without_a_section_of_the_template_is_refused(
    target: str, template: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    made_up = PerRow("made up", "made_up", {"amplitude": "amplitude", "order": "order", "phase": "phase"})
    monkeypatch.setitem(REGISTRIES[target], "torque_ripple", made_up)
    made = identified(short_set("planar-2r", tmp_path), plan("planar-2r", "torque_ripple:joint1").model)
    with pytest.raises(InputError, match=rf"{template}: has no section \[made_up\], .* for torque_ripple"):
        FORMATS[target](made)


def test_an_entry_of_code_that_writes_nothing_is_refused(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setitem(REGISTRIES["c"], "torque_ripple", Written("made up"))
    with pytest.raises(InputError, match="torque_ripple:joint1: the code has no place for"):
        identified(short_set("planar-2r", tmp_path), plan("planar-2r", "torque_ripple:joint1").model)
