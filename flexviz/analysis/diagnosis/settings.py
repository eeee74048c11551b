"""What a diagnosis takes of the settings of an identification."""

from __future__ import annotations

from dataclasses import replace

from flexviz.analysis.identification import FitSettings
from flexviz.base.errors import InputError
from flexviz.base.spelling import listed
from flexviz.data.measurements import MeasurementSet

ITS_OWN = ("observer", "bandwidth", "gains", "refine", "max_iterations")  # settings that a diagnosis chooses


def diagnosed_set(measurements: MeasurementSet, settings: FitSettings) -> MeasurementSet:
    """The set with the groups and effects of these settings.

    Raises:
        InputError: a setting that a diagnosis chooses itself, unknown names, or a validation group.
    """
    usual = FitSettings()
    given = [name for name in ITS_OWN if getattr(settings, name) != getattr(usual, name)]
    if given:
        has = "has" if len(given) == 1 else "have"
        message = f"{listed(given)} {has} no meaning in a diagnosis, which chooses observer and solver itself"
        raise InputError(f"{message}; expected groups and effects")
    if settings.groups is not None:
        fitted, held_out = measurements.select(settings.groups)
        chosen = tuple(group for group in measurements.groups if group in (*fitted, *held_out))
        measurements = replace(measurements, groups=chosen)
    return replace(measurements, effects=(*measurements.effects, *settings.effects))
