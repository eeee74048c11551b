"""The bandwidth sweep: which bandwidths to try, and residual and stiffness against bandwidth."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flexviz.charts import COLOURS, Line, Plot
from flexviz.wording import escape, number

if TYPE_CHECKING:
    from flexviz.identification import SweepResult

Array = NDArray[np.float64]

COUNT = 11  # bandwidths tried
FACTOR = 3.0  # the widest and the narrowest, relative to the present one
HEIGHT = 170  # [pixels]
LEAST_SPAN = 0.01  # of the stiffness's axis, relative: what moves less than this looks still
LINEAR = 20.0  # largest over smallest value up to which an axis is linear
PREFIXES = ((1e10, 1e-9, "G"), (1e7, 1e-6, "M"), (1e4, 1e-3, "k"))  # from, factor, prefix
X_LABEL = "bandwidth [rad/s]"


def sweep_bandwidths(present: float, lowest: float, highest: float, count: int = COUNT) -> tuple[float, ...]:
    """`count` bandwidths [rad/s] evenly spaced on a logarithmic scale around `present`, within the limits."""
    low, high = max(present / FACTOR, lowest), min(present * FACTOR, highest)
    return tuple(float(f"{w:.4g}") for w in np.geomspace(low, high, count))


def judged(result: SweepResult) -> Array:
    """(M, n) rms [Nm] the minimum is looked for in: held out, or fitted where nothing is held out."""
    return result.rms_fit if np.isnan(result.rms_validation).any() else result.rms_validation


def sweep_plots(result: SweepResult, joint: int, name: str) -> tuple[Plot, ...]:
    """Residual (its minimum marked) and stiffness of one joint against bandwidth, one plot each."""
    order = np.argsort(result.bandwidths)
    least = int(np.argmin(judged(result)[order, joint]))
    # the marked bandwidth stands three times in a row, so that its mark is a vertical line
    rows = np.concatenate((order[: least + 1], [order[least]] * 2, order[least + 1 :]))
    x = result.bandwidths[rows]
    mark = np.zeros(len(x))
    mark[least + 1] = 1.0
    lines = [Line("fit", COLOURS.series[3], result.rms_fit[rows, joint], dashed=True, points=True)]
    if not np.isnan(result.rms_validation).any():
        lines.append(
            Line("validation", COLOURS.residual, result.rms_validation[rows, joint], 2.0, points=True)
        )
    low, high, logarithmic = axis(result.stiffness[:, joint])
    factor, prefix = scaled(math.sqrt(low * high) if logarithmic else high)
    stiffness = Line("identified", COLOURS.model, factor * result.stiffness[rows, joint], 2.0, points=True)
    common: dict[str, Any] = {
        "x_label": X_LABEL,
        "height": HEIGHT,
        "span": rounded(float(x[0]), float(x[-1])),
        "logarithmic_x": True,
        "mark": mark,
    }
    return (
        Plot("residual", f"Residual of {name} [Nm]", x, tuple(lines), **common),
        Plot(
            "stiffness",
            f"Stiffness of {name} [{prefix}Nm/rad]",
            x,
            (stiffness,),
            range=(factor * low, factor * high),
            logarithmic=logarithmic,
            **common,
        ),
    )


def rounded(low: float, high: float) -> tuple[float, float]:
    """Limits around low and high (both positive); the first is a power of 2, from which the axis counts."""
    digit = 10.0 ** math.floor(math.log10(high))
    first, last = 2.0 ** math.floor(math.log2(low)), digit * math.ceil(high / digit)
    return first, max(last, 2.0 * first)


def axis(values: Array) -> tuple[float, float, bool]:
    """Limits of positive values, at least `LEAST_SPAN` of them apart, and whether the axis is logarithmic.

    It is where the stiffness is identified at some bandwidths and at its bound at others.
    """
    low, high = float(values.min()), float(values.max())
    if low > 0 and high > LINEAR * low:
        return 10.0 ** math.floor(math.log10(low)), 10.0 ** math.ceil(math.log10(high)), True
    middle = (low + high) / 2.0
    half = max(0.55 * (high - low), 0.5 * LEAST_SPAN * abs(middle), 1e-9)
    return middle - half, middle + half, False


def scaled(largest: float) -> tuple[float, str]:
    """Factor and prefix that leave a number short enough for an axis."""
    return next(((f, p) for limit, f, p in PREFIXES if largest >= limit), (1.0, ""))


def sweep_html(result: SweepResult, joint: int, name: str) -> str:
    """Where the minimum lies, for this joint and over all."""
    errors = judged(result)
    kind = "fit" if errors is result.rms_fit else "validation"
    least = int(np.argmin(errors[:, joint]))
    text = (
        f"{escape(name)}: least {kind} residual {number(float(errors[least, joint]), 3)} Nm "
        f"at {number(float(result.bandwidths[least]), 3)} rad/s (vertical line)."
    )
    if errors.shape[1] > 1:
        text += f" All joints together: {number(result.best, 3)} rad/s."
    if len(errors) > 1 and result.best in (result.bandwidths.min(), result.bandwidths.max()):
        text += " That is the end of the sweep: use it and sweep again."
    return f'<div class="fv">{text}</div>'
