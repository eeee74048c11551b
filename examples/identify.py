"""Identify a robot and read the result: `python examples/identify.py [SET]`."""

import sys
from pathlib import Path

import flexviz

DEMO = Path(__file__).resolve().parent.parent / "sessions" / "planar-2r-demo"

measurements = flexviz.read_set(sys.argv[1] if len(sys.argv) > 1 else DEMO)
result = flexviz.identify(measurements, effects=["coulomb_friction:joint2"])

print(result)  # one line
print(result.summary())  # the table of `flexviz identify`

stiffness = result["stiffness", "joint2"]
low, high = stiffness.value - 1.96 * stiffness.std, stiffness.value + 1.96 * stiffness.std
print(f"K of joint2: {stiffness.value:.1f} {stiffness.unit}, 95 % interval {low:.1f} … {high:.1f}")
