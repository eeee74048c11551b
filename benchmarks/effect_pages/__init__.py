"""docs/effects, made from the effect classes: `python -m benchmarks.effect_pages --write`."""
