"""The causal extended-state observer fed sample by sample, as in a controller: `python examples/live_eso.py`.

Prints, every half second, the observer's motor velocity at that instant, the velocity that a zero-phase
filter gives afterwards, and the mean time of one update.
"""

import time

import numpy as np

import flexviz

BANDWIDTH = 60.0  # [rad/s]
SHOWN = 0.5  # [s]

segment = flexviz.read_set("demo").groups[0].segments[0]
offline = flexviz.make_observer("butterworth-zero-phase", BANDWIDTH)
reference = offline.derivatives(segment.theta, segment.step, 2, position=True)[1]

eso = flexviz.make_observer("eso", BANDWIDTH)
live = eso.live(segment.step)
every, start = round(SHOWN / segment.step), time.perf_counter()
for count, angles in enumerate(segment.theta, 1):
    angle, velocity, *_, disturbance = live.update(angles)  # (n,) each
    if count % every == 0:
        spent = (time.perf_counter() - start) / count
        print(
            f"t = {segment.time[count - 1]:5.2f} s  ESO {np.round(velocity, 3)} rad/s  "
            f"zero phase {np.round(reference[count - 1], 3)} rad/s  {1e6 * spent:.0f} µs"
        )
print(f"The ESO's slowest state lags by {1e3 * eso.lag(segment.step):.0f} ms at 1 Hz.")
