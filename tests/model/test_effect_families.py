"""The table of families of effects."""

from __future__ import annotations

from flexviz.model.effects import EFFECT_FAMILIES, EFFECT_NAMES, family_of, kin


def test_every_member_is_an_effect_of_one_family() -> None:
    members = [effect for effects in EFFECT_FAMILIES.values() for effect in effects]
    assert set(members) <= set(EFFECT_NAMES) and len(set(members)) == len(members)
    assert family_of("link_coulomb_friction") == "dry_friction"
    assert family_of("cable_spring") == "constant_torque"
    assert family_of("torque_gain") == "torque_scale"
    assert family_of("backlash") is None


def test_a_law_that_is_not_the_simplest_of_its_family_is_chosen_from_all_of_them() -> None:
    for simplest, *others in EFFECT_FAMILIES.values():
        assert kin(simplest) == 1
        assert {kin(effect) for effect in others} == {1 + len(others)}
    assert kin("backlash") == 1  # of no family
