"""Colours of the links: the error of each joint beyond the noise floor, on a scale that keeps its end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.charts import COLOURS, cividis, css, gradient
from flexviz.diagnosis import PredictionErrors
from flexviz.diagnosis import Step as DiagnosisStep
from flexviz.wording import escape, number, short_names

Array = NDArray[np.float64]
Errors = PredictionErrors | DiagnosisStep
LEAST_END = 5.0  # times the noise floor: errors below are never drawn bright


@dataclass(frozen=True, eq=False)
class LinkColours:
    """Errors of the joints in a group, as shares of their torque, and their scale.

    Attributes:
        rms: shape (n,) [Nm].
        share: shape (n,), rms ÷ spread of the torque; NaN where the torque is constant.
        beyond: shape (n,), what the share has more than the noise floor.
        end: of the scale, which starts at the noise floor.
    """

    rms: Array
    share: Array
    beyond: Array
    end: float

    @property
    def colours(self) -> list[tuple[int, int, int]]:
        """cividis: dark at the noise floor, bright at the end; grey if unknown."""
        return [cividis(float(value) / self.end) for value in self.beyond]


def link_colours(
    errors: Errors | None, group: str, spread: Sequence[float], earlier: Sequence[Errors] = ()
) -> LinkColours | None:
    """Colours in a group; None if unknown. The scale ends at the largest error of all models."""
    rms = None if errors is None else _rms(errors, group)
    if errors is None or rms is None:
        return None
    width = np.where(np.asarray(spread, float) > 0, spread, np.nan)
    floor = np.asarray(errors.noise_floor or np.zeros(len(rms)), float)
    ends = [_beyond(one, group) / width for one in (errors, *earlier) if _rms(one, group) is not None]
    ends.append(LEAST_END * floor / width)
    end = float(np.nanmax(np.array(ends), initial=0.0))
    return LinkColours(rms, rms / width, _beyond(errors, group) / width, end or 1.0)


def _rms(errors: Errors, group: str) -> Array | None:
    return next((np.asarray(rms, float) for name, rms, _ in errors.groups if name == group), None)


def _beyond(errors: Errors, group: str) -> Array:
    """What the error has more than the noise floor, (n,) [Nm]."""
    rms = np.asarray(_rms(errors, group), float)
    return np.sqrt(np.maximum(rms**2 - np.asarray(errors.noise_floor or 0.0) ** 2, 0.0))


def legend_html(
    joints: tuple[str, ...], found: LinkColours | None, group: str, note: str = "", chosen: int = -1
) -> str:
    """Legend of the scene's colours with each joint's error; `note` tells how the model was simulated.

    The `chosen` joint is highlighted.
    """
    robots = (
        f'<div><span class="fv-box" style="background:{COLOURS.measured}"></span>measured: solid, blue trail '
        f'<span class="fv-box fv-ghost" style="background:{COLOURS.model}"></span>identified: ghost</div>'
    )
    if note:
        robots += f'<div class="fv-dim">{escape(note)}</div>'
    if found is None:
        waiting = "Links are coloured by their error after Run."
        return f'<div class="fv">{robots}<div class="fv-dim">{waiting}</div></div>'
    cells = "".join(
        f'<span class="fv-joint{" fv-chosen" if index == chosen else ""}" '
        f'title="{number(float(found.rms[index]), 3)} Nm">'
        f'<span class="fv-box" style="background:{css(colour)}"></span>'
        f"{escape(name)} {_percent(found, index)}</span>"
        for index, (name, colour) in enumerate(zip(short_names(joints), found.colours, strict=True))
    )
    return (
        f'<div class="fv">{robots}<div>Link colour: error in {escape(group)} [% of the joint\'s torque], '
        f'noise <span class="fv-map" style="background:{gradient()}"></span> '
        f"{number(100 * found.end, 2)}</div>"
        f'<div class="fv-joints">{cells}</div></div>'
    )


def _percent(found: LinkColours, index: int) -> str:
    share = float(found.share[index])
    return f"{number(100 * share, 2)}" if np.isfinite(share) else f"{number(float(found.rms[index]), 2)} Nm"
