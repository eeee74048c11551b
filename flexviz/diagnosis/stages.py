"""How long a diagnosis lasts, and how much of it is done when each of these stages begins."""

from flexviz.progress import Pace

OWN_MODEL = "fitting the set's own model to the noise"
USUAL = "fitting all usual effects on all joints"
ONE = "checking whether one effect explains all"
FIRST_MOVEMENT = "fitting the first movement after standstill"
NEED = "checking that the effect is needed"
STAIRS = "fitting the models on the way"
PLACE = "looking for the place of an unknown law"
AT_PLACE = "testing the effects of {}, where the model fails"
FINAL_REFIT = "refining the final parameters"
FREE_CURVE = "adding a free curve"
LOCATION = "locating the residual"
BANDWIDTH = "checking parameters against the observer's bandwidth"

SHARES = {
    USUAL: 0.08, ONE: 0.15, FIRST_MOVEMENT: 0.68, STAIRS: 0.73, NEED: 0.75, PLACE: 0.6, FINAL_REFIT: 0.9,
    FREE_CURVE: 0.92, LOCATION: 0.93, BANDWIDTH: 0.95,
}  # fmt: skip
"""By runs on sets of 2 to 7 joints, the first two on those that hide many effects or a law of no library."""

# by runs on sets of 2 to 7 joints with a single effect: the first stage takes a sixth of the time
FIRST_STAGE, LEAST_REST = 6.0, 1.2
SECONDS_PER_SIZE = 3.0  # first guess: times joints^1.6, the samples hardly matter


def pace(joints: int) -> Pace:
    """The pace of a diagnosis."""
    return Pace(SECONDS_PER_SIZE * joints**1.6, FIRST_STAGE, LEAST_REST, SHARES)
