"""From your robot's URDF and arrays to a measurement set: `python examples/own_robot.py OUT`.

The arrays here come from the example set, so that the script runs anywhere; replace `recorded` by your log.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import flexviz
from flexviz.measurements import GroupTable

URDF = Path(__file__).resolve().parent.parent / "robots" / "planar_2r" / "planar_2r.urdf"
JOINTS = ("joint1", "joint2")


def recorded(run: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time (N,) [s], motor angles and torques (N, n) [rad], [Nm] of one run, at the joint side."""
    demo = flexviz.read_set(URDF.parent.parent.parent / "sessions" / "planar-2r-demo")
    segment = demo.groups[run].segments[0]
    return segment.time, segment.theta, segment.tau


out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(tempfile.mkdtemp()) / "my_set"
groups = []
for run, (trajectory, validation) in enumerate((("slow", False), ("fast", False), ("other", True))):
    time, theta, tau = recorded(run)
    groups.append(
        GroupTable(
            name=f"run{run + 1}", trajectory=trajectory, payload="none", file=f"run{run + 1}.parquet",
            time=time, theta=theta, tau=tau, validation=validation,
        )
    )  # fmt: skip
flexviz.write_set(
    out, robot=URDF.name, joints=JOINTS, groups=groups, payloads={"none": ()}, files={URDF.name: URDF}
)

measurements = flexviz.read_set(out)  # checks units, signs of time, joints and links
print(out, [f"{group.name}: {group.duration:.1f} s" for group in measurements.groups])
