"""SciPy as an untyped module: type checkers misread some of its annotations.

SciPy loads a part when its name is first used: a command that needs neither `sp.interpolate` nor `sp.signal`
does not spend the quarter of a second that each takes.
"""

from typing import Any

import scipy

sp: Any = scipy
