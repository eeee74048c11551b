"""Late stages of a diagnosis: what is said of them, and how much is done when each begins."""

NEED = "checking that the effect is needed"
STAIRS = "fitting the models on the way"
FINAL_REFIT = "refining the final parameters"
FREE_CURVE = "adding a free curve"
LOCATION = "locating the residual"
BANDWIDTH = "checking parameters against the observer's bandwidth"

LATE_STAGES = {STAIRS: 0.65, NEED: 0.75, FINAL_REFIT: 0.9, FREE_CURVE: 0.92, LOCATION: 0.93, BANDWIDTH: 0.95}
"""By runs on sets of 2 to 7 joints."""
