"""The causal extended-state observer fed block by block, as in a controller: `python examples/live_eso.py`.

Prints, every half second, the observer's motor velocity at that instant, the velocity that a zero-phase
filter gives afterwards, and the time of one update.
"""

import time
from pathlib import Path

import numpy as np

import flexviz

DEMO = Path(__file__).resolve().parent.parent / "sessions" / "planar-2r-demo"
BANDWIDTH = 60.0  # [rad/s]
BLOCK = 0.5  # [s]

segment = flexviz.read_set(DEMO).groups[0].segments[0]
eso = flexviz.make_observer("eso", BANDWIDTH)
offline = flexviz.make_observer("butterworth-zero-phase", BANDWIDTH)
reference = offline.derivatives(segment.theta, segment.step, 2, position=True)[1]

block = round(BLOCK / segment.step)
memory = round(eso.settling()[0] / segment.step)  # what lies further back has faded
for end in range(memory + block, len(segment), block):
    start = time.perf_counter()
    window = segment.theta[end - memory - block : end]
    velocity = eso.derivatives(window, segment.step, 2, position=True)[1, -1]
    spent = time.perf_counter() - start
    print(
        f"t = {segment.time[end - 1]:5.2f} s  ESO {np.round(velocity, 3)} rad/s  "
        f"zero phase {np.round(reference[end - 1], 3)} rad/s  {1e3 * spent:.2f} ms"
    )
print(f"The ESO's slowest state lags by {1e3 * eso.lag(segment.step):.0f} ms at 1 Hz.")
