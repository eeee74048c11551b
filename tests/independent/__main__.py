"""Write cases and their truth; from tests/: `python -m independent FOLDER --seeds 1 2 --kinds backlash none`.

FOLDER/cases/NAME is a measurement set, FOLDER/truth/NAME.json what is true of it.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from independent.cases import NONE, ROBOTS, write_cases
from independent.hiding import KINDS
from independent.laws import STRANGE

parser = argparse.ArgumentParser(prog="independent", description=__doc__)
parser.add_argument("folder", type=Path)
parser.add_argument("--robot", choices=ROBOTS, default="2r")
parser.add_argument("--seeds", type=int, nargs="+", default=[1])
parser.add_argument(
    "--kinds", nargs="+", default=[*KINDS, *STRANGE, NONE], help="+ joins several in one case"
)
given = parser.parse_args()
write_cases(given.folder, [(seed, kind, given.robot) for kind in given.kinds for seed in given.seeds])
