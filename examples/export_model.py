"""Export an identified robot and use it: `python examples/export_model.py [OUT]`.

Writes URDF, MuJoCo model, parameters and code for feed-forward, then evaluates the exported Python code.
"""

import importlib.util
import sys
import tempfile
from pathlib import Path

import numpy as np

import flexviz

DEMO = Path(__file__).resolve().parent.parent / "sessions" / "planar-2r-demo"

measurements = flexviz.read_set(DEMO)
result = flexviz.identify(measurements, effects=["coulomb_friction:joint2"])
out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(tempfile.mkdtemp()) / "robot"
flexviz.export(measurements, result, out)
print(*sorted(path.name for path in out.iterdir()), sep="\n")

file = next(out.glob("*_dynamics.py"))
spec = importlib.util.spec_from_file_location("dynamics", file)
assert spec is not None and spec.loader is not None
dynamics = importlib.util.module_from_spec(spec)
spec.loader.exec_module(dynamics)
q, dq, ddq, zero = np.array([0.3, -0.5]), np.array([0.5, 0.2]), np.array([1.0, -1.0]), np.zeros(2)
tau, theta, *_ = dynamics.inverse_dynamics(q, dq, ddq, zero, zero)
print("feed-forward torque", np.round(tau, 3), "Nm, motor angles", np.round(theta, 5), "rad")
