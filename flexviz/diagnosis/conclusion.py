"""The final model of a diagnosis, with its verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.constancy import ChangingSize
from flexviz.diagnosis.fit_context import Fit
from flexviz.diagnosis.notes import notes
from flexviz.diagnosis.prediction_errors import PredictionErrors
from flexviz.diagnosis.records import BandwidthCheck, FreeCurve
from flexviz.diagnosis.result import Finding
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.estimation import Covariance
from flexviz.results import Note, Verdict

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Conclusion:
    """The model that a result describes.

    Attributes:
        fit, verdict, covariance: of this model.
        refined: refitted with weights closer to the noise.
        changing: a size that changes during the recordings; None if all are constant.
    """

    fit: Fit
    verdict: Verdict
    covariance: Covariance
    refined: bool = False
    changing: ChangingSize | None = None

    @property
    def puzzling(self) -> bool:
        """Whether the residual stays above the noise for no known reason."""
        return self.verdict == "unknown" and self.changing is None

    def doubted(self, findings: Sequence[Finding]) -> list[Finding]:
        """The findings, with little confidence in an effect whose size changes: it imitates another law."""
        if self.changing is None:
            return list(findings)
        name, most = self.changing.named, THRESHOLDS.motion.doubtful
        return [
            replace(f, confidence=min(f.confidence, most))
            if (f.effect, f.joint, f.group, f.payload) == name
            else f
            for f in findings
        ]

    def notes(
        self,
        errors: PredictionErrors,
        model_error_variance: Array | None,
        curve: FreeCurve | None,
        bandwidths: BandwidthCheck | None,
    ) -> tuple[Note, ...]:
        """The size that changes, and the other notes (`notes`)."""
        first = () if self.changing is None else (Note("changing", self.changing.text),)
        return (*first, *notes(self.fit, self.verdict, errors, model_error_variance, curve, bandwidths))
