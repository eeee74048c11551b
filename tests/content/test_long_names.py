"""Tables of results keep every number and every verdict, whatever the joints are called."""

from __future__ import annotations

from typing import Any

import pytest

from flexviz.content.rendering import text
from flexviz.content.results import ResultDocument
from flexviz.content.wording import number, short_names

VENDOR = tuple(f"AR5-5_07R-W4C4A2_joint_{k}" for k in range(1, 8))
NAMES = {
    "a vendor's prefix and numbers": VENDOR,
    "twelve joints": tuple(f"AR5-5_07R-W4C4A2_joint_{k}" for k in range(1, 13)),
    "no common prefix": tuple(
        f"{side}_{part}_motor_joint"
        for side in ("left_gantry", "right")
        for part in ("shoulder_pan", "elbow_flexion", "wrist_rotation")
    ),
    "long and alone": ("the_only_joint_of_this_exceptionally_long_test_bench_pendulum",),
    "short": ("joint1", "joint2"),
    "only numbers differ": ("1", "2", "3"),
}


def document(joints: tuple[str, ...], steps: int = 4) -> ResultDocument:
    """A diagnosis of these joints with values that are easy to find: 1x.x % fitted, held out 2x.x %."""
    n = len(joints)
    spread = [10.0] * n
    friction = {"effect": "coulomb_friction", "joint": joints[0], "confidence": 0.99}
    values = {"coulomb": {"value": 3.0, "std": 0.01, "unit": "Nm"}}

    def step(k: int) -> dict[str, Any]:
        rms = [1.11 + 0.1 * j + 0.01 * (steps - k) for j in range(n)]
        found = {"rms": rms, "rms_validation": rms, "noise_floor": [0.0123] * n, "verdict": "missing"}
        effects = ("coulomb_friction", "backlash", "torque_ripple", "torque_offset")
        added = {"effect": effects[k - 1], "joint": joints[k % n], "confidence": 0.9} if k else None
        return found | {"added": added}

    parameter = {"name": "motor_viscous_friction", "unit": "Nm s/rad", "value": 12.345, "std": 0.01}
    residual = {"joints": joints, "rms": spread, "rms_validation": spread, "noise_floor": spread}
    return ResultDocument.from_dict(
        {
            "format": 1,
            "set": "s",
            "verdict": "missing",
            "torque": {"joints": joints, "spread": spread},
            "candidates": [friction | {"score": 0.9, "parameters": values}],
            "steps": [step(k) for k in range(steps)],
            "parameters": [parameter | {"joint": joint, "identifiable": "yes"} for joint in joints],
            "residual": residual,
        }
    )


@pytest.mark.parametrize("width", [80, 100, 160])
@pytest.mark.parametrize("names", NAMES)
def test_no_cell_of_a_diagnosis_is_cut_off(names: str, width: int) -> None:
    joints = NAMES[names]
    whole = document(joints)
    said = text(whole.blocks(), width)
    lines = said.splitlines()
    table = lines[next(i for i, line in enumerate(lines) if "Rms residual of each joint" in line) :]
    assert "…" not in "\n".join(table)
    assert max(len(line) for line in table if "→" not in line and "note" not in line) <= width
    words = "\n".join(table).split()
    for j in range(len(joints)):
        assert any(w in words for w in error_texts(whole, j)), (error_texts(whole, j), said)
    assert said.count("missing") >= 4 and any("mean" in line for line in table) == (len(joints) > 1)
    assert "\n".join(table).count("(12.3 mNm)") >= len(joints)  # the noise of each


def error_texts(whole: ResultDocument, joint: int) -> tuple[str, ...]:
    """What the last error of a joint may be written as, in per cent of its torque."""
    step, spread = whole.steps[-1], whole.torque_spread
    share = 100 * (step.rms_validation or step.rms)[joint] / spread[joint]
    return tuple(number(share, digits) for digits in (2, 3))


@pytest.mark.parametrize("width", [80, 160])
@pytest.mark.parametrize("names", NAMES)
def test_no_cell_of_an_identification_is_cut_off(names: str, width: int) -> None:
    joints = NAMES[names]
    plain = {
        k: v for k, v in document(joints).to_dict().items() if k not in ("verdict", "steps", "candidates")
    }
    said = text(ResultDocument.from_dict(plain).blocks(), width)
    assert "…" not in said and said.count("12.345") == len(joints)
    assert said.count("10.0 Nm") == 3 * len(joints) and said.count("motor_viscous_friction") >= len(joints)


def test_short_names_keep_a_letter_and_stay_different() -> None:
    assert short_names(VENDOR) == [f"joint_{k}" for k in range(1, 8)]
    assert short_names(("panda_joint1", "panda_joint2")) == ["joint1", "joint2"]
    assert short_names(("arm-a:j1", "arm-a:j2")) == ["j1", "j2"]
    assert short_names(("a_1", "a_2")) == ["a_1", "a_2"] and short_names(("1", "2")) == ["1", "2"]
    assert short_names(("r_elbow", "left")) == ["r_elbow", "left"] and short_names(("x_y",)) == ["x_y"]
    assert short_names(("robot_elbow", "robot_")) == ["robot_elbow", "robot_"]
