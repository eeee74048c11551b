"""Diagnose many sets in parallel, one line each in a CSV file: `python examples/batch.py OUT.csv [SET …]`.

A set that cannot be read is a row with its error, not the end of the run.
"""

import csv
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import flexviz

DEMO = Path(__file__).resolve().parent.parent / "sessions" / "planar-2r-demo"


def row(folder: Path) -> dict[str, object]:
    """Verdict and first finding of one set."""
    try:
        diagnosis = flexviz.diagnose(flexviz.read_set(folder), apply=True)
    except flexviz.FlexvizError as error:
        return {
            "set": folder.name,
            "verdict": "",
            "effect": "",
            "joint": "",
            "confidence": "",
            "error": str(error),
        }
    best = diagnosis.findings[0] if diagnosis.findings else None
    return {
        "set": folder.name,
        "verdict": diagnosis.verdict,
        "effect": best.effect if best else "",
        "joint": best.joint if best else "",
        "confidence": f"{best.confidence:.2f}" if best else "",
        "error": "",
    }


if __name__ == "__main__":
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(tempfile.mkdtemp()) / "batch.csv"
    folders = [Path(name) for name in sys.argv[2:]] or [DEMO]
    with ProcessPoolExecutor(max_workers=2) as pool, out.open("w", newline="") as file:
        rows = list(pool.map(row, folders))
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)
    print(out.read_text())
