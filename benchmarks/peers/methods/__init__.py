"""One file per method: `estimate(problem)` is what a user of that method writes."""
