"""Diagnose many sets in parallel, one line each: `python examples/batch.py RESULTS [SET …]`.

A set that cannot be read is a row with its error, not the end of the run; the same call goes on where an
earlier one was interrupted. Needs dask.distributed: pip install 'flexviz[batch]'.
"""

import sys
import tempfile
from pathlib import Path

from flexviz.batch import run_batch

DEMO = Path(__file__).resolve().parent.parent / "sessions" / "planar-2r-demo"

if __name__ == "__main__":  # the workers are new processes that import this file
    results = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
    folders = sys.argv[2:] or [str(DEMO)]
    with tempfile.TemporaryDirectory() as temporary:
        sets = Path(temporary) / "sets.txt"
        sets.write_text("\n".join(str(Path(folder).resolve()) for folder in folders))
        done = run_batch(sets, results)
    for row in done.rows:
        confidence = "" if row.confidence is None else f"{row.confidence:.2f}"
        print(row.set.rpartition("/")[2], row.verdict, ";".join(row.found), confidence, row.error, sep=",")
    print(f"{results / 'results.parquet'} has all values, {results / 'summary.html'} shows them")
