"""Hidden effects of servos that follow goals, by MuJoCo: which are named, which are false, and the intervals.

    python -m benchmarks.servos [--sets 60] [--seed 1] [--json FILE]

One joint, a planar arm and the SO-101 (where ../shared is beside the project); 0 to 3 hidden effects on
random joints, or on none, each of which changes the motion by more than an encoder's count; with and without
a mass that gives torques a scale.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.independent.servo_simulator import COUNT, PENDULUM, STEP, Servo, random_goals, simulated

SHARED = Path(__file__).resolve().parents[1].parent / "shared"
EFFECTS = (
    "coulomb_friction", "load_dependent_friction", "driving_friction", "stribeck_friction", "torque_limit",
    "goal_delay", "goal_lag", "goal_speed_limit", "dead_band",
)  # fmt: skip
ROBOTS = ("pendulum", "upright", "planar", "so101")


@dataclass(frozen=True)
class Case:
    """One set: what is hidden on each joint, and what came out."""

    robot: str
    seed: int
    hidden: tuple[tuple[str, str], ...]
    named: tuple[tuple[str, str], ...]
    verdict: str
    last: str
    inside: tuple[bool, ...]
    sure: tuple[str, ...]
    seconds: float
    scale: float


def size_of(effect: str, torque: float, goal_speed: float, rng: np.random.Generator) -> tuple[float, ...]:
    """A visible size."""
    u = float(rng.uniform(0.7, 1.4))
    return {
        "coulomb_friction": (0.3 * torque * u,),
        "load_dependent_friction": (0.3 * u,),
        "driving_friction": (0.1 * u, 0.4 * u),
        "stribeck_friction": (0.4 * torque * u, 0.1 * u),
        "torque_limit": (1.2 * torque * u,),
        "goal_delay": (round(20 * u) * 1e-3,),
        "goal_lag": (0.03 * u,),
        "goal_speed_limit": (0.45 * goal_speed * u,),
        "dead_band": (0.006 * u,),
    }[effect]


def run(robot: str, seed: int, folder: Path) -> Case:
    """Simulate and diagnose one set."""
    import flexviz

    rng = np.random.default_rng([seed, ROBOTS.index(robot)])
    urdf, joints, servos, reach = robot_of(robot, folder, rng)
    n, every = len(joints), 0.01 if robot != "so101" else 0.02
    motions = {f"g{k}": random_goals(1000 * seed + k, n, reach, 1.0) for k in range(4)}
    bare = simulated(urdf, joints, servos, motions["g0"], 6.0, every)
    torque = np.std((bare["theta_ref"] - bare["theta"]) * [s.gain for s in servos], axis=0)
    speed = np.abs(np.diff(bare["theta_ref"], axis=0)).max(axis=0) / every
    chosen: list[tuple[str, int]] = []
    for _ in range(int(rng.integers(0, 4))):
        j = int(rng.integers(n))
        effect = str(rng.choice(EFFECTS))
        taken = {e for e, k in chosen if k == j}
        if robot == "upright" and effect in ("load_dependent_friction", "driving_friction"):
            continue  # without a load there is none
        if effect in taken or ({"load_dependent_friction", "driving_friction"} <= {effect, *taken}):
            continue
        if effect == "stribeck_friction" and "coulomb_friction" not in taken:
            chosen.append(("coulomb_friction", j))
        chosen.append((effect, j))
    truth = []
    for j, servo in enumerate(servos):
        own = {e: size_of(e, float(torque[j]), float(speed[j]), rng) for e, k in chosen if k == j}
        truth.append(Servo(servo.gain, servo.armature, servo.viscous, own))
    chosen = [one for one in chosen if shows(one, truth, urdf, joints, motions["g0"], every)]
    runs = {}
    for name, goals in motions.items():
        found = simulated(urdf, joints, truth, goals, 15.0, every)
        runs[name] = {key: value for key, value in found.items()}
    began = time.process_time()
    read = flexviz.MeasurementSet.from_arrays(
        urdf, runs, joints=joints, validation=["g3"], drive={"from": "goal"}, name=f"{robot}-{seed}"
    )
    result = flexviz.diagnose(read, apply=True)
    hidden = tuple(sorted((e, joints[j]) for e, j in chosen))
    named = tuple(sorted((one_of(f, hidden), f.joint or "") for f in result.findings))
    inside, sure = intervals(result, joints, truth)
    gain = result["position_control.gain", joints[0]].value / truth[0].gain
    return Case(
        robot, seed, hidden, named, result.verdict, result.steps[-1].verdict, inside, sure,
        time.process_time() - began, gain,
    )  # fmt: skip


def shows(
    one: tuple[str, int],
    truth: list[Servo],
    urdf: Path,
    joints: Sequence[str],
    goals: Callable[[float], np.ndarray],
    every: float,
) -> bool:
    """Whether an effect changes its joint's motion by more than a count; one that does not is taken away.

    As load-dependent friction of a joint that carries nothing.
    """
    effect, j = one
    with_it = simulated(urdf, joints, truth, goals, 6.0, every)["theta"][:, j]
    own = {e: size for e, size in truth[j].effects.items() if e != effect}
    servo = Servo(truth[j].gain, truth[j].armature, truth[j].viscous, own)
    without = simulated(urdf, joints, [*truth[:j], servo, *truth[j + 1 :]], goals, 6.0, every)["theta"][:, j]
    if np.std(with_it - without) > COUNT:
        return True
    truth[j] = servo
    return False


def one_of(finding, hidden) -> str:
    """What a finding names: the hidden effect if that is one of those which it cannot be told from."""
    for tie in finding.inseparable_from:
        if (tie.effect, tie.joint or finding.joint) in hidden and (
            finding.effect,
            finding.joint,
        ) not in hidden:
            return tie.effect
    return finding.effect


def intervals(
    result, joints: Sequence[str], truth: Sequence[Servo]
) -> tuple[tuple[bool, ...], tuple[str, ...]]:
    """Whether what is determined lies inside its 95 % interval; and what is graded "yes"."""
    inside, sure = [], []
    for p in result.parameters:
        servo = truth[joints.index(p.joint)]
        held = servo.gain * STEP / 2  # a torque that is held for a step is half a step late
        own = {
            "motor_inertia": servo.armature,
            "motor_viscous_friction": servo.viscous - held,
            "position_control.gain": servo.gain,
        }
        effect, _, parameter = p.name.partition(".")
        if p.name in own:
            value = own[p.name]
        elif effect in servo.effects:
            from flexviz.effects import EFFECTS as KNOWN

            value = servo.effects[effect][[q.name for q in KNOWN[effect].parameters].index(parameter)]
        else:
            continue
        if p.identifiable == "yes":
            sure.append(p.name)
        if p.identifiable != "no" and np.isfinite(p.std):
            inside.append(abs(p.value - value) <= 1.96 * p.std)
    return tuple(inside), tuple(sure)


def robot_of(
    robot: str, folder: Path, rng: np.random.Generator
) -> tuple[Path, list[str], list[Servo], float]:
    """Its URDF, joints, servos without effects, and reach of its goals [rad]."""
    u = lambda: float(rng.uniform(0.7, 1.4))  # noqa: E731
    if robot in ("pendulum", "upright"):
        axis = "0 1 0" if robot == "pendulum" else "0 0 1"
        urdf = folder / f"{robot}.urdf"
        urdf.write_text(PENDULUM.format(mass=0.6, i=2e-4, axis=axis))
        return urdf, ["hinge"], [Servo(12 * u(), 0.02 * u(), 0.5 * u())], 1.2
    if robot == "planar":
        from flexviz.base.resources import robots_dir

        urdf = robots_dir() / "planar_2r/planar_2r.urdf"
        return (
            urdf,
            ["joint1", "joint2"],
            [Servo(300 * u(), 1.0 * u(), 8 * u()), Servo(150 * u(), 0.5 * u(), 4 * u())],
            0.8,
        )
    names = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll"]
    servos = [Servo(13 * u(), 0.03 * u(), 0.8 * u()) for _ in names]
    return SHARED / "real" / "so101" / "so101.urdf", names, servos, 0.8


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default=",".join(ROBOTS))
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    import tempfile

    robots = [r for r in given.only.split(",") if r != "so101" or SHARED.is_dir()]
    cases: list[Case] = []
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(2) as pool:
        asked = [(robots[k % len(robots)], given.seed * 1000 + k, Path(folder)) for k in range(given.sets)]
        for case in pool.map(run, *zip(*asked, strict=True)):
            cases.append(case)
            missed, false = set(case.hidden) - set(case.named), set(case.named) - set(case.hidden)
            print(
                f"{case.robot:9s} {case.seed} hidden {len(case.hidden)} missed {sorted(missed)} "
                f"false {sorted(false)} {case.verdict}, {case.last}; inside {sum(case.inside)} of "
                f"{len(case.inside)}; {case.seconds:.0f} s; gain × {case.scale:.2f}",
                flush=True,
            )
    hidden = sum(len(c.hidden) for c in cases)
    named = sum(len(set(c.hidden) & set(c.named)) for c in cases)
    false = sum(len(set(c.named) - set(c.hidden)) for c in cases)
    inside = [one for c in cases for one in c.inside]
    clean = [c.verdict == "nothing-missing" for c in cases if not c.hidden]
    print(
        f"{len(cases)} sets: {named} of {hidden} named, {false} false; inside {np.mean(inside):.3f} of "
        f"{len(inside)}; clean with nothing missing: {sum(clean)} of {len(clean)}"
    )
    if given.json:
        given.json.write_text(json.dumps([c.__dict__ for c in cases], default=str, indent=1))


if __name__ == "__main__":
    main()
