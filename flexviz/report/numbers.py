"""A report as JSON: results, settings and data hashes."""

from __future__ import annotations

from dataclasses import asdict

from flexviz import __version__
from flexviz.files import as_json
from flexviz.report.content import ReportContent
from flexviz.report.sections.effects import next_experiments
from flexviz.report.sections.errors import group_rows
from flexviz.report.sections.summary import sentence, warnings

FORMAT = 1


def numbers(content: ReportContent, when: str) -> str:
    """The JSON text; numbers that are not finite are null."""
    analysis, measurements = content.analysis, content.measurements
    # the steps of the present model alone; the whole staircase follows
    diagnosis = None if content.diagnosis is None else content.diagnosis.to_dict(steps=False)
    document = {
        "format": FORMAT,
        "flexviz": __version__,
        "written": when,
        "summary": sentence(content),
        "warnings": warnings(content),
        "simulated": measurements.simulated,
        "set": {
            "name": measurements.name,
            "path": str(measurements.path),
            "sha256": content.fingerprint.sha256,
            "files": [asdict(file) for file in content.fingerprint.files],
        },
        "session": None if content.folder is None else str(content.folder),
        "settings": {
            "joints": content.joints,
            "roles": dict(analysis.roles),
            "effects": analysis.effects,
            "observer": analysis.observer,
            "bandwidth": analysis.bandwidth,
            "refine": analysis.refine,
        },
        "staircase": [
            {
                "added": one.added,
                "rms": one.model.step.rms,
                "rms_validation": one.model.step.rms_validation,
                "noise_floor": one.model.step.noise_floor,
                "verdict": one.model.step.verdict,
            }
            for one in content.rounds
        ],
        "groups": [
            {"name": name, "used_to": used, "rms": values}
            for name, used, values in (group_rows(content.steps) if content.steps else ())
        ],
        "added": [
            {"effect": name, "finding": None if finding is None else finding.to_dict()}
            for name, finding in content.added
        ],
        "diagnosis": diagnosis,
        "identification": None if content.identification is None else content.identification.to_dict(),
        "guard": None if diagnosis is None else diagnosis["guard"],
        "next_experiments": next_experiments(content, content.found),
        "history": [{"when": s.when, "label": s.label, "flexviz": s.version} for s in content.session.steps],
        "notes": [{"when": note.when, "text": note.text} for note in content.session.notes],
        "recordings": [str(file) for file in content.session.recordings],
    }
    return as_json(document)
