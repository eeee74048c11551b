"""From arrays to a result, without files: `python examples/arrays.py`.

The arrays come from the example set, so that the script runs anywhere; take those of your own log. A pandas
DataFrame or xarray Dataset with the same columns does as well.
"""

import numpy as np

import flexviz

recorded = flexviz.read_set("demo").groups[0].segments[0]
time: np.ndarray = recorded.time  # (N,) [s]
theta: np.ndarray = recorded.theta  # (N, n) motor angles at the joint side [rad]
tau: np.ndarray = recorded.tau  # (N, n) motor torques at the joint side [Nm]

run = {"time": time, "theta": theta, "tau": tau}
measurements = flexviz.MeasurementSet.from_arrays("robots:planar_2r", {"run1": run})
result = flexviz.identify(measurements, effects=["coulomb_friction:joint2"])
friction = result["coulomb_friction.coulomb", "joint2"]
print(f"Coulomb friction of joint2: {friction.value:.3f} ± {1.96 * friction.std:.3f} {friction.unit}")

try:
    flexviz.MeasurementSet.from_arrays("robots:planar_2r", run | {"theta": np.degrees(theta)})
except flexviz.InputError as error:
    print(error)
