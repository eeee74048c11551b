"""benchmarks/results/peers.md: the text around the tables."""

# ruff: noqa: E501

from __future__ import annotations

import os
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path

from benchmarks.peers import claims, tables
from benchmarks.peers.running import ROOT, THIS, versions
from benchmarks.peers.sets import Case

PAGE = ROOT / "benchmarks" / "results" / "peers.md"
Results = Sequence[tuple[Case, Sequence[tables.Row]]]

HEAD = """\
# Other methods on the same sets: all tables

[The page](../../docs/peers.md) says what they mean.

`python -m benchmarks.peers --data DIR --figaroh PYTHON --mujoco PYTHON --write` makes this page. DIR holds the practice sets
(`practice/`, truth beside them) and the recordings (`real/`); the paper's group B is simulated. Each method runs on each set
in a process of its own, one at a time, one thread, at most {limit:.0f} s of CPU. FIGAROH (`pip install figaroh==1.0.2`) and
`mujoco[sysid]` are not among flexviz's requirements; the two options name an interpreter that has them. `--work DIR --resume`
continues a run that was interrupted.

{environment}

{overall}

## The methods

| method | what it is here |
|---|---|
| flexviz identify, `--refine` | this program, with the same friction terms as the other methods |
| flexviz diagnose `--apply` | where friction is hidden: this program, told of viscous friction only |
| trust-constr | the paper's way: its equation 6 (four derivatives of θ, samples every 25 ms) minimised by SciPy's interior-point method with finite differences, over base inertial parameters, K, B and friction on both sides. A zero-phase filter at 8 Hz in place of the paper's causal observer, which is 4–22 % off in stiffness |
| mujoco.sysid | simulated against measured motor angle, over K, B, friction on both sides and a pseudo-inertia per link: rotor and link as two hinges and a tendon, RK4 at 2 ms, driven by the measured torque and a soft servo; links start at q = θ − s/K, friction above zero |
| IDIM-LS | inverse dynamics of the rigid robot, weighted least squares on base parameters around the URDF's; position filter 20 Hz, parallel filter at a quarter of the first elastic mode |
| IDIM-IV | the same with the regressor of a simulated rigid robot as instruments, iterated |
| DIDIM | output error on the torque of the simulated rigid robot; the measured position does not enter the regressor |
| FIGAROH | the package's weighted least squares (rigid) with motor inertia, viscous and Coulomb friction; decimated to the same band |

Every method starts at the values of the set and of its URDF and knows the payloads. The rigid methods also fit motor inertia and
friction; what a method cannot estimate is {none}. Where the controller of a recording is unknown, IDIM-IV and DIDIM simulate
with a PD controller of 20 Hz on the measured angle. Gautier, Jubien and Janot (2013) extend DIDIM to joint stiffness; it needs the
controller and is not compared. Given to all methods but `diagnose`: Coulomb friction on every joint in 2r-coulomb_friction; Coulomb
friction and offsets on the KUKA (offsets not to trust-constr and mujoco.sysid, whose scripts have none).

The columns: largest error of each kind over the joints, relative to the truth (or to a tenth of the largest of its kind, if that
is more). An asterisk: flexviz itself marks the value as not determined by the data.
*Viscous friction* is the sum of both sides, *link inertia* the base parameters of the links ("R": a regrouped sum).
*Held out*: torque that the model does not explain in runs that no method has fitted, rms while moving ÷ standard deviation
of the torque, mean over joints, by the same filter (5 Hz) and the same equation for all. CPU and wall time start with the
interpreter, *computing* is CPU time after its imports; the wall clock depends on what else the machine does. *Evaluations*: passes
of the model over the data, one per column of a finite-difference Jacobian. *MB*: largest resident memory. *Lines*: what a
user writes beside reading the data, without blank lines, comments and texts; IDIM-LS, IDIM-IV and DIDIM have no package, so it
is the whole method.

No method can be exact on the two planar practice sets: their recordings bias motor inertia. In 2r-none-19, equation 6 leaves
−9e-4 θ̈ on joint 1 and −5e-4 θ̈ on joint 2 at the exact truth; in 20 planar practice sets the motor inertia identified for
joint 2 is too small by 4.6 to 5.4e-4 kg m², whatever its value, stiffness, friction and noise
(`python -m benchmarks.motor_inertia PRACTICE`). A controller that
interpolates its reference between the rows has this effect ([what to record](../../docs/bring-your-own-robot.md#what-to-record),
`tests/model/test_torque_sampling.py`); the sets do not state theirs. It is .05 to .08 % of B, 5 to 100 standard errors of
`--refine`, which is therefore behind where another method's own error happens to compensate it.

The scripts for mujoco.sysid avoid three obstacles of MuJoCo 4.0.0: its pseudo-inertia modifier does not compile without an
orientation, its rollout labels sensor readings one step late (states are compared instead), and its resampling can add a step
(it is switched off).
"""

TAIL = """\
## References

- M. Gautier, Dynamic identification of robots with power model, IEEE International Conference on Robotics and Automation, 1997
  (weighted least squares).
- A. Janot, P.-O. Vandanjon, M. Gautier, A generic instrumental variable approach for industrial robot identification, IEEE
  Transactions on Control Systems Technology, 2014 (IDIM-IV).
- M. Gautier, A. Janot, P.-O. Vandanjon, A new closed-loop output error method for parameter identification of robot dynamics, IEEE
  Transactions on Control Systems Technology, 2013 (DIDIM).
- M. Gautier, A. Jubien, A. Janot, New closed-loop output error method for robot joint stiffness identification with motor
  force/torque data, American Control Conference, 2013.
- MuJoCo's system identification toolbox, `mujoco.sysid`; FIGAROH, github.com/thanhndv212/figaroh-plus.
- The paper's simulation: [the paper's simulation, repeated](../../docs/paper.md).
"""


def section(case: Case, rows: Sequence[tables.Row]) -> str:
    """One set: its table, what it says of the claims, and every quantity."""
    parts = [f"## {case.name}", case.text[0].upper() + case.text[1:] + ".", tables.summary(rows)]
    parts += [f"- {claim.text}" for claim in claims.claims(case, rows)]
    found = tables.details(rows)
    if found:
        parts += ["Error of every quantity in per cent:", found]
    joined = "\n\n".join(parts)
    return joined.replace("\n\n- ", "\n- ").replace("|\n- ", "|\n\n- ")


def environment(pythons: Mapping[str, str]) -> str:
    """Machine and versions."""
    own = versions(THIS, ("flexviz", "pin", "numpy", "scipy"))
    parts = [f"Python {own.pop('Python')}", *(f"{name} {v}" for name, v in own.items() if v)]
    for name, python in pythons.items():
        version = versions(python, (name,))[name]
        parts.append(f"{name} {version}" if version else f"{name} not installed")
    return f"{_processor()}, {os.cpu_count()} cores, {platform.system()}; " + ", ".join(parts) + "."


def _processor() -> str:
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.machine()


def write(results: Results, limit: float, pythons: Mapping[str, str]) -> None:
    """Renew the page."""
    found = claims.overall((case.name, claims.claims(case, rows)) for case, rows in results)
    overall = "\n".join(f"- {text}" for text in found)
    head = HEAD.format(limit=limit, environment=environment(pythons), overall=overall, none=tables.NONE)
    sections = [section(case, rows) for case, rows in results]
    if any(row.outcome.failure == "not run" for _, rows in results for row in rows):
        sections.append(
            "Rows that say *not run* were left out for time: this page was put together from kept runs (`--resume`)."
        )
    PAGE.write_text("\n".join([head, *(f"{text}\n" for text in sections), TAIL]), encoding="utf-8")
