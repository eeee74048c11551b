"""How long a diagnosis lasts, and how much of it is done when each of these stages begins."""

from flexviz.progress import Pace

OWN_MODEL = "fitting the set's own model to the noise"
USUAL = "fitting all usual effects on all joints"
FINE = "refining the model in units of the sensors' noise"
STAIRS = "fitting the models on the way"
PLACE = "looking for the place of an unknown law"
FREE_CURVE = "adding a free curve"
LOCATION = "locating the residual"
BANDWIDTH = "checking parameters against the observer's bandwidth"

SHARES = {
    USUAL: 0.1, FINE: 0.6, STAIRS: 0.75, FREE_CURVE: 0.9, LOCATION: 0.85, PLACE: 0.9, BANDWIDTH: 0.95,
}  # fmt: skip

# by runs on sets of 2 to 7 joints with a single effect: the first stage takes a sixth of the time
FIRST_STAGE, LEAST_REST = 6.0, 1.2
SECONDS_PER_SIZE = 3.0  # first guess: times joints^1.6, the samples hardly matter


def pace(joints: int) -> Pace:
    """The pace of a diagnosis."""
    return Pace(SECONDS_PER_SIZE * joints**1.6, FIRST_STAGE, LEAST_REST, SHARES)
