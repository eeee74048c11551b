"""The comparison with other methods: its own rigid methods, its table, and a method that fails."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.peers import claims, tables
from benchmarks.peers.judging import Judged, Quantity
from benchmarks.peers.methods import didim, idim_iv, idim_ls
from benchmarks.peers.prepare import moving_urdf
from benchmarks.peers.problem import COULOMB, Group, Problem
from benchmarks.peers.running import METHODS, Method, Outcome, code_lines, run
from benchmarks.peers.sets import CASES
from flexviz.robot._pinocchio import pin
from flexviz.robot.robot import PayloadBody, Robot

MOTOR, VISCOUS, COULOMB_TORQUE = np.array([2.0, 1.2]), np.array([0.8, 0.5]), np.array([3.0, 1.5])


def rigid_problem(folder: Path) -> tuple[Problem, Robot]:
    """A rigid planar arm, noise-free: torque by Newton–Euler along sines; the URDF is 20 % off."""
    robot = Robot.load("robots:planar_2r")
    urdf = folder / "robot.urdf"
    urdf.write_text(moving_urdf(robot.urdf, robot.joints), encoding="utf-8")
    time = np.arange(0, 6, 0.001)
    groups = []
    for name, speeds, mass in (("a", (1.9, 2.7), 0.0), ("b", (3.1, 1.3), 2.0)):
        waves = [(c + np.sin(w * time + c), w) for c, w in zip((0.3, 0.8), speeds, strict=True)]
        q = np.stack([y for y, _ in waves], axis=1)
        v = np.stack([w * np.cos(w * time + c) for c, w in zip((0.3, 0.8), speeds, strict=True)], axis=1)
        a = np.stack([-(w**2) * (y - c) for c, (y, w) in zip((0.3, 0.8), waves, strict=True)], axis=1)
        bodies = (PayloadBody("link2", mass, (0.3, 0.0, 0.0), (0.01, 0.01, 0.01, 0, 0, 0)),)
        model = robot.model_with(robot.cad_parameters, bodies)
        data = model.createData()
        links = np.array([pin.rnea(model, data, *row) for row in zip(q, v, a, strict=True)])
        tau = links + MOTOR * a + VISCOUS * v + COULOMB_TORQUE * np.tanh(v / 0.005)
        groups.append(Group(name, False, robot.payload_parameters(bodies), time, q, tau, None))
    stiffness = np.full(2, 1e6)
    rough = 1.2 * robot.cad_parameters
    links_moved = ("link1", "link2")
    return Problem(
        folder, urdf, robot.joints, links_moved, 0.0, stiffness, MOTOR * 1.3, None, None,
        (COULOMB,), rough, tuple(groups),
    ), robot  # fmt: skip


@pytest.mark.parametrize(("method", "within"), [(idim_ls, 2e-3), (idim_iv, 5e-3), (didim, 0.03)])
def test_rigid_methods_recover_a_rigid_robot(method, within, tmp_path) -> None:
    problem, _robot = rigid_problem(tmp_path)
    found = method.estimate(problem)
    assert found["converged"]
    np.testing.assert_allclose(found["motor_viscous_friction"], VISCOUS, rtol=within, atol=within)
    coulomb = [effect["parameters"]["coulomb"] for effect in found["effects"]]
    np.testing.assert_allclose(coulomb, COULOMB_TORQUE, rtol=within)


def row(name: str, errors: list[float | None], cpu: float, held_out: float, noise: float = 0.0) -> tables.Row:
    """A method's row with these errors of two stiffnesses (truth 1000) and of friction (truth 2)."""
    kinds = ("stiffness", "K 1"), ("stiffness", "K 2"), ("viscous friction", "f_l+f_m 1")
    judged = tuple(
        Judged(Quantity(kind, label), truth, error, noise)
        for (kind, label), truth, error in zip(kinds, (1e3, 1e3, 2.0), errors, strict=True)
    )
    method = next(m for m in METHODS if m.name == name)
    answer = {"converged": True, "computing": cpu / 2, "evaluations": 7}
    return tables.Row(method, Outcome(answer, "", cpu, 2 * cpu, 250.4), judged, held_out)


def test_table_and_findings() -> None:
    failed = tables.Row(METHODS[4], Outcome(failure="no result within 240 s of CPU", cpu=240.0, wall=300.0))
    rows = [
        row("flexviz_refine", [1e-4, 2e-4, 3e-3], 2.0, 0.001, 5e-4),
        row("flexviz_identify", [0.01, 0.02, 0.004], 1.5, 0.002),
        row("trust_constr", [0.01, 0.02, 0.003], 60.0, 0.02),
        row("idim_ls", [None, None, 2.8e-3], 1.0, 0.3),
        failed,
    ]
    lines = tables.summary(rows).splitlines()
    assert lines[0].startswith("| method | stiffness [%] | viscous friction [%] | held out [%] |")
    assert len({line.count("|") for line in lines}) == 1
    assert lines[2] == "| flexviz identify --refine | 0.02 | 0.3 | 0.1 | 2.0 | 1.0 | 4.0 | 7 | 250 | 1 |"
    assert lines[5].startswith("| IDIM-LS, rigid | — | 0.28 | 30 |")
    assert lines[6].startswith("| mujoco.sysid | no result within 240 s of CPU | — | — | 240.0 | — | 300.0 |")
    decided = claims.claims(CASES[0], rows)
    found = [claim.text for claim in decided]
    assert found[0] == "Accuracy: flexviz identify --refine first in 2 of 3 quantities, within noise in 1."
    assert "first, 0.1 % against 2 %" in found[1]
    assert "at least 120.0 times as fast as mujoco.sysid" in found[2]
    assert found[3] == (
        "Speed: flexviz identify 40.0 times as fast as trust-constr, the paper's way in CPU time, "
        "start included (claim 50: not met); computing alone 40 times."
    )
    crashed = tables.Row(METHODS[4], Outcome(failure="its simulation diverges", cpu=1.3, wall=1.5))
    text = claims.claims(CASES[0], [*rows[:-1], crashed])[2].text
    assert text == "Speed: mujoco.sysid failed at once: nothing to compare."
    assert tables.percent(12.0) == "> 1000"
    assert claims.overall([("a", decided)]) == [
        "First or within noise in every quantity: met on a.",
        "Smallest held-out error: met on a.",
        "At least 20 times as fast as mujoco.sysid: met on a.",
        "At least 50 times as fast as trust-constr: not met on a.",
    ]


def test_a_method_that_fails_is_a_row(tmp_path) -> None:
    outcome = run(Method("idim_ls", "IDIM-LS"), tmp_path, sys.executable, 20.0)
    assert outcome.answer is None
    assert outcome.failure.startswith("FileNotFoundError")
    kept = run(Method("idim_ls", "IDIM-LS"), tmp_path, "no interpreter", 20.0, resume=True)
    assert kept.failure == outcome.failure
    missing = run(Method("no_such", "X", (), "some-package==1"), tmp_path, sys.executable, 20.0)
    assert missing.failure == "not installed: pip install 'some-package==1'"
    assert code_lines('"""Text."""\n\n# no\nx = 1\ny = (\n    x\n)\n') == 4
