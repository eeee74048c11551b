"""Each method in a fresh process, with a limit on its processor time."""

from __future__ import annotations

import ast
import json
import os
import resource
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from benchmarks.running import wait

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
NOTHING = ""  # in place of an interpreter: only what an earlier run has kept
LONGEST = 80  # characters of an error in the table
WALL = 30  # a process may take this many times its limit by the wall clock


@dataclass(frozen=True)
class Method:
    """One way to identify.

    Attributes:
        name: of its module in `methods`, or its function in `flexviz_answer`.
        label: in tables.
        files: what a user writes for it, beside reading the data; none: one command.
        package: what is missing where it cannot be imported.
    """

    name: str
    label: str
    files: tuple[str, ...] = ()
    package: str = ""


_RIGID = ("rigid.py", "derivatives.py", "methods/idim_ls.py")
METHODS = (
    Method("flexviz_identify", "flexviz identify"),
    Method("flexviz_refine", "flexviz identify --refine"),
    Method("flexviz_diagnose", "flexviz diagnose --apply"),
    Method("trust_constr", "trust-constr, the paper's way", ("derivatives.py", "methods/trust_constr.py")),
    Method("mujoco_sysid", "mujoco.sysid", ("derivatives.py", "methods/mujoco_sysid.py"), "mujoco[sysid]"),
    Method("idim_ls", "IDIM-LS, rigid", _RIGID),
    Method("idim_iv", "IDIM-IV, rigid", (*_RIGID, "closed_loop.py", "methods/idim_iv.py")),
    Method("didim", "DIDIM, rigid", (*_RIGID, "closed_loop.py", "methods/idim_iv.py", "methods/didim.py")),
    Method("figaroh", "FIGAROH, rigid", ("derivatives.py", "methods/figaroh.py"), "figaroh==1.0.2"),
)


@dataclass(frozen=True)
class Outcome:
    """What became of one method on one set.

    Attributes:
        answer: as `problem.answer` returns it; None if there is none.
        failure: why there is none.
        cpu, wall: [s], the start of the interpreter included.
        megabytes: largest memory.
    """

    answer: dict[str, Any] | None = None
    failure: str = ""
    cpu: float = float("nan")
    wall: float = float("nan")
    megabytes: float = float("nan")


def run(method: Method, problem: Path, python: str, limit: float, resume: bool = False) -> Outcome:
    """Run one method in a process of its own, or with `resume` read what an earlier run has kept."""
    kept = problem / f"{method.name}.outcome.json"
    if python == NOTHING and not kept.exists():
        return Outcome(failure="not run")
    if not (resume and kept.exists()):
        kept.write_text(json.dumps(asdict(_run(method, problem, python, limit))), encoding="utf-8")
    return Outcome(**json.loads(kept.read_text(encoding="utf-8")))


def _run(method: Method, problem: Path, python: str, limit: float) -> Outcome:
    out = problem / f"{method.name}.json"
    out.unlink(missing_ok=True)
    command = [python, "-m", "benchmarks.peers.child", method.name, str(problem), str(out)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (round(limit), round(limit) + 5))

    began = time.monotonic()
    with (problem / f"{method.name}.log").open("wb") as log:
        process = subprocess.Popen(
            command, env=environment, stdout=log, stderr=log, cwd=problem, preexec_fn=limited,
            start_new_session=True,
        )  # fmt: skip
        ended = wait(process, began, WALL * limit)
    cpu, wall = ended.cpu, ended.wall
    if not out.exists():
        why = f"the process ended with status {ended.code}"
        if cpu >= 0.98 * limit:
            why = f"no result within {limit:.0f} s of CPU"
        elif ended.code is None:
            why = f"no result within {WALL * limit:.0f} s"
        return Outcome(failure=why, cpu=cpu, wall=wall)
    answer = json.loads(out.read_text(encoding="utf-8"))
    megabytes = answer.pop("megabytes")
    if "missing" in answer:
        return Outcome(failure=f"not installed: pip install '{method.package or answer['missing']}'")
    if "error" in answer:
        return Outcome(failure=answer["error"][:LONGEST], cpu=cpu, wall=wall, megabytes=megabytes)
    return Outcome(answer, "", cpu, wall, megabytes)


def lines(method: Method) -> int:
    """Lines of code a user writes: without blanks, comments and texts; one command is one line."""
    return sum(code_lines((HERE / name).read_text(encoding="utf-8")) for name in method.files) or 1


def code_lines(source: str) -> int:
    """Lines of Python that hold code."""
    tree = ast.parse(source)
    texts: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            texts |= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    rows = enumerate(source.splitlines(), start=1)
    return sum(1 for i, row in rows if row.strip() and not row.strip().startswith("#") and i not in texts)


def versions(python: str, names: tuple[str, ...]) -> dict[str, str]:
    """Installed versions of packages in an interpreter."""
    code = (
        "import importlib.metadata as m, json, sys\n"
        "def v(n):\n"
        "    try: return m.version(n)\n"
        "    except m.PackageNotFoundError: return ''\n"
        "print(json.dumps({n: v(n) for n in sys.argv[1:]} | {'Python': sys.version.split()[0]}))"
    )
    done = subprocess.run([python, "-c", code, *names], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


THIS = sys.executable
