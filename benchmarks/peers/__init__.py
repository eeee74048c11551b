"""flexviz beside its peers on the same sets: `python -m benchmarks.peers`."""
