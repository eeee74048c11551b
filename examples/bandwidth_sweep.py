"""Residual and stiffness against the observer's bandwidth: `python examples/bandwidth_sweep.py [SET]`.

A parameter that moves while the residual stays flat is observer error.
"""

import sys
from pathlib import Path

import flexviz

DEMO = Path(__file__).resolve().parent.parent / "sessions" / "planar-2r-demo"

measurements = flexviz.read_set(sys.argv[1] if len(sys.argv) > 1 else DEMO)
found = flexviz.sweep(
    measurements, "butterworth-zero-phase", [15.0, 25.0, 40.0, 65.0], effects=["coulomb_friction:joint2"]
)
print("bandwidth [rad/s]   stiffness [Nm/rad]   held-out rms [Nm]")
for bandwidth, stiffness, rms in zip(found.bandwidths, found.stiffness, found.rms_validation, strict=True):
    print(f"{bandwidth:17.0f}   {stiffness.round(1)}   {rms.round(4)}")
print(f"least held-out error at {found.best:.0f} rad/s")
