"""Temperatures of the groups, and friction that falls with them from run to run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from import_data import truth
from small_set import write_small_set

from flexviz.analysis.diagnosis import diagnose
from flexviz.analysis.diagnosis.candidates import candidates
from flexviz.analysis.identification import identify
from flexviz.base.errors import InputError
from flexviz.content.wording import temperature_text
from flexviz.data.importing import import_logs
from flexviz.data.measurements import GroupTable, MeasurementSet, read_set, write_set
from flexviz.model.effects import EFFECTS, ChosenEffect, JointMotion
from flexviz.model.equation import Layout
from flexviz.model.simulation import inject, laws, make_plan, move, simulate_plan, write_plan
from tests.data.test_import_mapping import SIMPLE
from tests.data.test_import_mapping import write as write_log
from tests.planar_arm import of_groups

EFFECT = "temperature_friction"
HIDDEN = f"{EFFECT}:joint2:viscous_fall=0.02,coulomb_fall=0.03"
COULOMB = "coulomb_friction:joint2:coulomb=3"


def stating(folder: Path, **lines: str) -> Path:
    """The small set, with a temperature in the groups of these tables (g1, g2, g3)."""
    file = write_small_set(folder) / "measurements.toml"
    text = file.read_text()
    for group, line in lines.items():
        text = text.replace(f'name = "{group}"', f'name = "{group}"\ntemperature = {line}')
    file.write_text(text)
    return file.parent


# -- the format


def test_one_number_or_one_per_joint(tmp_path: Path) -> None:
    first = read_set(stating(tmp_path / "set", g1="25", g2="[30.5, -10.0]"))
    a, b, c = (group.temperature for group in first.groups)
    assert a is not None and b is not None and c is None
    assert a.tolist() == [25.0, 25.0] and b.tolist() == [30.5, -10.0]
    assert [temperature_text(t) for t in (a, b, c)] == ["25 °C", "30.5, -10 °C", ""]
    tables = [GroupTable.of(group) for group in first.groups]
    assert tables[2].temperature is None
    copied = write_set(
        tmp_path / "copy",
        robot="robots:planar_2r",
        joints=first.joints,
        groups=tables,
        payloads=first.payloads,
    )
    second = read_set(copied)
    assert [g.temperature is None for g in second.groups] == [False, False, True]
    np.testing.assert_array_equal(second.groups[1].temperature, [30.5, -10.0])


@pytest.mark.parametrize(
    "line, message",
    [
        ("298.15", r"group 2 \"g2\", temperature: found 298.15, expected -60 to 250 °C"),
        ("[20.0, -61]", "found -61, expected -60 to 250"),
        ("[20.0, 21.0, 22.0]", r"temperature: 3 values for 2 joints, expected one per joint \(2\)"),
        ("[]", "0 values for 2 joints"),
        ("nan", "temperature, entry 1: found nan, expected a finite number"),
        ('"warm"', 'found "warm", expected a number'),
        ("true", "found true, expected a number"),
    ],
)
def test_other_temperatures_are_refused(tmp_path: Path, line: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_set(stating(tmp_path / "set", g2=line))


def test_a_mapping_may_state_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("flexviz.data.importing.importing.torque_delay", lambda *_: None)
    for line, expected in (("31", [31.0, 31.0]), ("[31, 40.5]", [31.0, 40.5])):
        folder = tmp_path / f"{len(line)}"
        folder.mkdir()
        mapping = SIMPLE.replace('group = "g1"', f'group = "g1"\ntemperature = {line}')
        done = import_logs(write_log(folder, mapping), folder / "set", accept=True)
        assert done.folder is not None and len(truth(rows=600).time)
        np.testing.assert_array_equal(read_set(done.folder).groups[0].temperature, expected)
    wrong = write_log(folder, mapping.replace("40.5", "400"))
    with pytest.raises(InputError, match=r'log 1 "g1", temperature: found 400, expected'):
        import_logs(wrong, folder / "other", accept=True)


# -- the effect


def test_closed_form_at_several_temperatures() -> None:
    velocity = np.array([-1.5, -0.2, 0.3, 2.0])
    nothing = np.zeros(4)
    for degrees in (-10.0, 20.0, 55.0):
        motion = JointMotion(
            nothing, nothing, velocity, nothing, nothing, nothing, 1.0, 1.0, 1.0, temperature=degrees
        )
        law = EFFECTS[EFFECT]
        u = law.law(motion, np.array([0.03, -0.1]))[0]  # type: ignore[attr-defined]
        expected = (20 - degrees) * (0.03 * velocity - 0.1 * np.sign(velocity))
        np.testing.assert_allclose(u, expected, atol=1e-12)
        simulated = laws.temperature_friction(0.03, -0.1, degrees)
        np.testing.assert_allclose(u, [simulated(0.0, 0.0, v, 0.0) for v in velocity.tolist()], atol=1e-12)


@pytest.fixture(scope="module")
def warm(tmp_path_factory: pytest.TempPathFactory) -> MeasurementSet:
    """Viscous friction of joint 2 falls by half, Coulomb friction by a quarter."""
    plan = make_plan("planar-2r", [HIDDEN, COULOMB])
    plan = of_groups(plan, [g.name for g in plan.groups], 8.0)
    return read_set(write_plan(plan, simulate_plan(plan, 3), tmp_path_factory.mktemp("warm") / "set", 3))


def test_groups_state_what_was_simulated(warm: MeasurementSet) -> None:
    assert [g.temperature.tolist() for g in warm.groups if g.temperature is not None] == [
        [25.0, 25.0], [45.0, 45.0], [35.0, 35.0], [40.0, 40.0],
    ]  # fmt: skip
    again = make_plan(warm.path)
    assert [g.temperature for g in again.groups] == [(t, t) for t in (25.0, 45.0, 35.0, 40.0)]
    plan = make_plan("planar-2r", ["none"], temperatures=[31.0])
    assert {g.temperature for g in plan.groups} == {(31.0, 31.0)}
    assert {g.temperature for g in make_plan("planar-2r").groups} == {None}
    groups = tuple(
        replace(g, temperature=t) for g, t in zip(plan.groups, (None, *3 * [(31.0, 32.0)]), strict=True)
    )
    filled = inject(replace(plan, groups=groups), [HIDDEN])
    assert [g.temperature for g in filled.groups] == [(25.0, 25.0), *3 * [(31.0, 32.0)]]
    for wrong in ([20.0, 30.0], [400.0]):
        with pytest.raises(InputError, match="temperature"):
            make_plan("planar-2r", temperatures=wrong)


def test_identification_recovers_it(warm: MeasurementSet) -> None:
    names = ["coulomb_friction:joint2", f"{EFFECT}:joint2"]
    without, result = (identify(warm, effects=names[:k], refine=True) for k in (1, 2))
    assert result.residual.rms[1] < 0.2 * without.residual.rms[1]
    truth = {f"{EFFECT}.viscous_fall": 0.02, f"{EFFECT}.coulomb_fall": 0.03, "coulomb_friction.coulomb": 3.0}
    for name, true in truth.items():
        found = result[name, "joint2"]
        assert found.std is not None and abs(found.value - true) < 5 * found.std + 1e-3 * true, found


def test_diagnosis_names_it(warm: MeasurementSet) -> None:
    found = diagnose(replace(warm, effects=("coulomb_friction",)), apply=True)
    first = found.findings[0]
    assert (first.effect, first.joint) == (EFFECT, "joint2")
    assert first.parameters["viscous_fall"].value == pytest.approx(0.02, rel=0.01)
    assert first.parameters["coulomb_fall"].value == pytest.approx(0.03, rel=0.01)
    assert [s.verdict for s in found.steps] == ["missing", "nothing-missing"]


def test_an_effect_needs_the_temperature_of_every_group(warm: MeasurementSet) -> None:
    groups = tuple(replace(g, temperature=None) if g.name == "t3p3" else g for g in warm.groups)
    with pytest.raises(InputError, match='group "t3p3" states none: expected temperature'):
        identify(replace(warm, groups=groups), effects=[EFFECT])


def test_it_is_a_candidate_only_where_temperatures_differ(warm: MeasurementSet) -> None:
    layout = Layout(warm.joints)

    def tried(*degrees: tuple[float, float] | None) -> list[int | None]:
        """Joints on which it is tried where three groups to fit and one held out have these temperatures."""
        each = (None if d is None else np.array(d) for d in degrees)
        groups = [replace(g, temperature=d) for g, d in zip(warm.groups, each, strict=True)]
        return [e.joint for e in candidates(layout, groups) if e.effect == EFFECT]

    cold, half, hot = (20.0, 20.0), (20.0, 30.0), (40.0, 40.0)
    assert tried(cold, hot, hot, cold) == [0, 1]
    assert tried(cold, half, cold, hot) == [1]
    assert tried(cold, cold, cold, hot) == []  # the held-out group is not fitted
    assert tried(cold, hot, None, cold) == tried(cold, hot, hot, None) == tried(None, None, None, None) == []
    have = Layout(warm.joints, (ChosenEffect(EFFECT, 0),))
    assert [e.joint for e in candidates(have, warm.groups) if e.effect == EFFECT] == [1]


def test_a_replay_follows_the_temperature() -> None:
    plan = make_plan("planar-2r", [HIDDEN], temperatures=[20.0])
    short = tuple(replace(g, duration=2.0) for g in plan.groups[:1])
    none = replace(plan, groups=short, model=replace(plan.model, effects=()))
    hot = replace(plan, groups=tuple(replace(g, temperature=(45.0, 45.0)) for g in short))
    still, cold, warm = (move(p)["t1p1"] for p in (none, replace(plan, groups=short), hot))
    np.testing.assert_array_equal(cold.theta, still.theta)
    assert np.abs(warm.tau - still.tau)[:, 1].max() > 0.1
