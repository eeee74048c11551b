"""Find the effect that a model is missing and add it: `python examples/missing_effect.py [SET]`."""

import sys
from pathlib import Path

import flexviz

DEMO = Path(__file__).resolve().parent.parent / "sessions" / "planar-2r-demo"

measurements = flexviz.read_set(sys.argv[1] if len(sys.argv) > 1 else DEMO)
diagnosis = flexviz.diagnose(measurements, apply=True)

print(diagnosis.summary())
for step in diagnosis.steps:
    added = "the set's model" if step.added is None else f"+ {step.added.effect} on {step.added.joint}"
    print(f"{added}: held-out rms {step.rms_validation} Nm, {step.verdict}")
