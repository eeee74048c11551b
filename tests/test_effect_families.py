"""The table of families of effects."""

from __future__ import annotations

from flexviz.effects import EFFECT_FAMILIES, EFFECT_NAMES, family_of


def test_every_member_is_an_effect_of_one_family() -> None:
    members = [effect for effects in EFFECT_FAMILIES.values() for effect in effects]
    assert set(members) <= set(EFFECT_NAMES) and len(set(members)) == len(members)
    assert family_of("link_coulomb_friction") == "dry_friction"
    assert family_of("cable_spring") == "constant_torque"
    assert family_of("torque_gain") == "torque_scale"
    assert family_of("backlash") is None
