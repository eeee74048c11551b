"""Define an effect of your own, hide it in a simulated robot, identify it: `python examples/user_effect.py`.

The effect is a class in examples/user_effects.py; loading the file checks it (units, shapes, slopes).
"""

import tempfile
from pathlib import Path

import flexviz
from flexviz.outlets.terminal import main

EFFECTS = Path(__file__).resolve().parent / "user_effects.py"

flexviz.load_effects(EFFECTS)
folder = Path(tempfile.mkdtemp()) / "hidden"
main(["simulate", "planar-2r", "--effect", "worm_gear_friction:joint2", "--out", str(folder)])

result = flexviz.identify(flexviz.read_set(folder), effects=["worm_gear_friction:joint2"])
for name in ("forward", "backward"):
    found = result[f"worm_gear_friction.{name}", "joint2"]
    print(f"{name}: {found.value:.3f} ± {1.96 * found.std:.3f} {found.unit}")
