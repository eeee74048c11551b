"""Messages in one line, and the names that they suggest."""

from __future__ import annotations

from flexviz.base.errors import FlexvizError, InputError, choose_from


def test_choices_in_messages() -> None:
    assert choose_from("x", []) == "there is nothing to choose from"
    assert choose_from("b", ["aa", "bb"]) == "valid: aa, bb" or "did you mean" in choose_from(
        "b", ["aa", "bb"]
    )
    assert choose_from("nothing", [f"joint{i}" for i in range(20)]).endswith("(20 in all)")
    assert str(InputError("a\nb\tc", file="f", place="p")) == "f, p: a b c"
    assert str(FlexvizError("several\n lines")) == "several lines"
    assert choose_from("colomb", ["stribeck_friction", "coulomb_friction"]).startswith(
        'did you mean "coulomb'
    )
