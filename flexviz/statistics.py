"""Statistics that every room shares."""

NORMAL_95 = 1.96  # standard errors in half a 95 % interval of a normal distribution
