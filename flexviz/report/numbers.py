"""A report as JSON, for programs: what the commands give, and everything needed to get it again."""

from __future__ import annotations

from typing import Any

from flexviz import __version__
from flexviz.diagnosis import BandwidthCheck
from flexviz.files import as_json
from flexviz.report.gathering import Subject
from flexviz.report.sections.staircase import group_rows
from flexviz.report.sections.summary import sentence, warnings
from flexviz.report.sections.telling_apart import next_experiments

FORMAT = 1


def numbers(subject: Subject, when: str) -> str:
    """The JSON text; what is not finite is null."""
    analysis, measurements = subject.analysis, subject.measurements
    diagnosis = None if subject.diagnosis is None else subject.diagnosis.to_json()
    if diagnosis is not None:
        del diagnosis["steps"]  # the present model's alone; the whole staircase follows
    found = [finding for _, finding in subject.added if finding is not None]
    document = {
        "format": FORMAT,
        "flexviz": __version__,
        "written": when,
        "summary": sentence(subject),
        "warnings": warnings(subject),
        "simulated": measurements.simulated,
        "set": {
            "name": measurements.name,
            "path": str(measurements.path),
            "sha256": subject.fingerprint.sha256,
            "files": [
                {"name": f.name, "sha256": f.sha256, "bytes": f.bytes} for f in subject.fingerprint.files
            ],
        },
        "session": None if subject.folder is None else str(subject.folder),
        "settings": {
            "joints": list(subject.joints),
            "roles": dict(analysis.roles),
            "effects": list(analysis.effects),
            "observer": analysis.observer,
            "bandwidth": analysis.bandwidth,
            "refine": analysis.refine,
        },
        "staircase": [
            {
                "added": list(round_.added),
                "rms": list(round_.stair.step.rms),
                "rms_validation": _list(round_.stair.step.rms_validation),
                "noise_floor": list(round_.stair.step.noise_floor),
                "verdict": round_.stair.step.verdict,
            }
            for round_ in subject.rounds
        ],
        "groups": [
            {"name": name, "used_to": used, "rms": values}
            for name, used, values in (group_rows(subject.steps) if subject.steps else ())
        ],
        "added": [
            {"effect": name, "finding": None if finding is None else finding.to_json()}
            for name, finding in subject.added
        ],
        "diagnosis": diagnosis,
        "identification": None if subject.identification is None else subject.identification.to_json(),
        "guard": _guard(subject.diagnosis.guard if subject.diagnosis is not None else None),
        "next_experiments": next_experiments(subject, found),
        "history": [{"when": s.when, "label": s.label, "flexviz": s.version} for s in subject.session.steps],
        "notes": [{"when": note.when, "text": note.text} for note in subject.session.notes],
        "recordings": [str(file) for file in subject.session.recordings],
    }
    return as_json(document)


def _guard(found: BandwidthCheck | None) -> dict[str, Any] | None:
    if found is None:
        return None
    return {
        "observer": found.observer,
        "bandwidths": found.bandwidths.tolist(),
        "in_use": int(found.in_use),
        "joints": [
            {
                "joint": joint,
                "rms": found.rms[:, j].tolist(),
                "change": found.change[:, j].tolist(),
                "change_noise": found.change_noise[:, j].tolist(),
                "observer_error": bool(found.observer_error[j]),
            }
            for j, joint in enumerate(found.joints)
        ],
        "parameters": [
            {
                "name": p.name,
                "joint": p.joint,
                "place": p.place,
                "unit": p.unit,
                "values": p.values.tolist(),
                "std": p.std.tolist(),
                "moved": p.moved,
                "trusted": p.trusted,
            }
            for p in found.parameters
        ],
        "texts": list(found.texts()),
    }


def _list(values: tuple[float, ...] | None) -> list[float] | None:
    return None if values is None else list(values)
