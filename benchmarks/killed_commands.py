"""Commands killed (-9) while they work and write: `python -m benchmarks.killed_commands [KILLS]`.

Half of the kills fall at a random moment, half as soon as something hidden appears beside the result. After
each one the name of the result must hold nothing, what was there before, or a complete new result. At the end
the next program that writes there must remove what was left. The exit code is 1 if not.
"""

from __future__ import annotations

import os
import random
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from benchmarks.command import command
from benchmarks.fuzz_readers import make_mapping
from flexviz.base.errors import FlexvizError, InputError
from flexviz.base.files import ABANDONED, PART, remove_leftovers
from flexviz.content.results import read_result
from flexviz.data.measurements import read_set
from flexviz.outlets.recording import check_recording
from flexviz.outlets.terminal import main as flexviz
from flexviz.robot.robot import Robot
from tests.recorded import readable_part
from tests.small_set import write_small_set

SEED = 5
TIMEOUT = 120.0  # [s] for one command
OLD = "what was there before"


@dataclass(frozen=True)
class Command:
    """A command, the name of its result, and a check that raises unless a result is complete."""

    arguments: tuple[str, ...]
    out: str
    check: Callable[[Path], object]
    share: float  # of all kills
    replaces: bool = True  # a file that is there already


def complete_page(file: Path) -> None:
    if not file.read_text().rstrip().endswith("</html>"):
        raise ValueError("half a page")


def complete_recording(file: Path) -> None:
    """A recording grows under its name; what was flushed must be there, with or without a footer."""
    try:
        check_recording(file)
    except InputError as error:
        if "is truncated" not in str(error):
            raise
        readable = readable_part(file)
        check_recording(readable)
        readable.unlink()


def complete_export(folder: Path) -> None:
    read_result(folder / "parameters.json")
    (urdf,) = folder.glob("*.urdf")
    Robot.load(urdf)


RECORD = Command(("record", "set", "--out"), "recorded.rrd", complete_recording, 0.2)
COMMANDS = (
    Command(("identify", "set", "--json"), "identified.json", read_result, 0.25),
    Command(("diagnose", "set", "--json"), "diagnosed.json", read_result, 0.05),
    Command(("import", "log/mapping.toml", "--out"), "imported", read_set, 0.25, False),
    Command(
        ("export", "set", "--to", "urdf", "--to", "json", "--out"), "exported", complete_export, 0.2, False
    ),
    Command(("report", "set", "--out"), "report.html", complete_page, 0.05),
    RECORD,
)


def prepare() -> None:
    """A small set and a log to import, in the current folder."""
    write_small_set(Path("set"))
    Path("log").mkdir()
    make_mapping(Path("log"))


def start(command: Command) -> int:
    """The command in a child process."""
    child = os.fork()
    if child:
        return child
    null = os.open(os.devnull, os.O_RDWR)
    for stream in (1, 2):
        os.dup2(null, stream)
    try:
        flexviz([*command.arguments, f"out/{command.out}"])
    finally:
        os._exit(0)


def ended(child: int, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
    """Wait for a child, a condition or a time; whether the child has ended."""
    begin = time.monotonic()
    while time.monotonic() - begin < seconds and not until():
        if os.waitpid(child, os.WNOHANG)[0]:
            return True
        time.sleep(0.0005)
    return False


def clear(command: Command) -> Path:
    """Put back what was there before."""
    out = Path("out", command.out)
    for left in Path("out").glob(f"{out.stem}*"):
        left.rename(Path("done", f"{time.monotonic_ns()}"))
    if command.replaces:
        out.write_text(OLD)
    return out


def problem(command: Command, out: Path) -> tuple[str, str]:
    """What the name of the result holds after a kill, and what is wrong with it ("": nothing)."""
    if not out.exists():
        return "nothing", "" if not command.replaces else "what was there before is lost"
    if out.is_file() and out.read_bytes() == OLD.encode():
        return "what was there before", ""
    try:
        command.check(out)
    except (FlexvizError, OSError, ValueError) as error:
        return "half a result", str(error)
    return "a new result", ""


@command
def main(kills: int = 100) -> int:
    return kill_all({command: round(command.share * kills) for command in COMMANDS})


def kill_all(counts: Mapping[Command, int]) -> int:
    """Kill each command so many times, look, count; 1 if something is wrong."""
    rng = random.Random(SEED)
    wrong: list[str] = []
    with tempfile.TemporaryDirectory() as temporary:
        os.chdir(temporary)
        Path("out").mkdir()
        Path("done").mkdir()
        prepare()
        for command, kills in counts.items():
            clear(command)
            begin = time.monotonic()
            if not ended(start(command), TIMEOUT):
                raise TimeoutError(command.arguments[0])
            whole = time.monotonic() - begin
            command.check(Path("out", command.out))
            found: Counter[str] = Counter()
            for kill in range(kills):
                out = clear(command)
                before = set(Path("out").iterdir())
                child = start(command)
                if kill % 2:
                    over = ended(child, TIMEOUT, lambda: set(Path("out").iterdir()) != before)  # noqa: B023
                    over = over or ended(child, rng.uniform(0.0, 0.01))
                else:
                    over = ended(child, rng.uniform(0.0, whole))
                if not over:
                    os.kill(child, signal.SIGKILL)
                    os.waitpid(child, 0)
                holds, why = problem(command, out)
                found[holds + (" (ended before)" if over else "")] += 1
                if why:
                    wrong.append(f"{command.arguments[0]}: {why}")
            held = ", ".join(f"{count} {what}" for what, count in found.most_common())
            print(f"{command.arguments[0]:9} {found.total()} kills within {whole:.1f} s: {held}", flush=True)
        left = list(Path("out").glob(f"*{PART}"))
        for one in left:
            long_ago = time.time() - 2 * ABANDONED
            os.utime(one, (long_ago, long_ago))
        remove_leftovers(Path("out"))
        kept = len(list(Path("out").glob(f"*{PART}")))
        os.chdir("/")
    print(f"{len(left)} leftovers, {kept} of them not removed; {len(wrong)} results lost or half written")
    for line in wrong:
        print(line)
    return int(bool(wrong or kept))


if __name__ == "__main__":
    sys.exit(main())
