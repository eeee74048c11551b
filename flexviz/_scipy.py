"""Parts of SciPy whose annotations type checkers misread, as untyped modules."""

from typing import Any

import scipy.fft

fft: Any = scipy.fft
