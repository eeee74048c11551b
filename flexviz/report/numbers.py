"""A report as JSON, for programs: what the commands give, and everything needed to get it again."""

from __future__ import annotations

from typing import Any

from flexviz import __version__
from flexviz.diagnosis import BandwidthCheck
from flexviz.files import as_json
from flexviz.report.content import ReportContent
from flexviz.report.sections.staircase import group_rows
from flexviz.report.sections.summary import sentence, warnings
from flexviz.report.sections.telling_apart import next_experiments

FORMAT = 1


def numbers(content: ReportContent, when: str) -> str:
    """The JSON text; what is not finite is null."""
    analysis, measurements = content.analysis, content.measurements
    diagnosis = None if content.diagnosis is None else content.diagnosis.to_json()
    if diagnosis is not None:
        del diagnosis["steps"]  # the present model's alone; the whole staircase follows
    found = [finding for _, finding in content.added if finding is not None]
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
            "files": [
                {"name": f.name, "sha256": f.sha256, "bytes": f.bytes} for f in content.fingerprint.files
            ],
        },
        "session": None if content.folder is None else str(content.folder),
        "settings": {
            "joints": list(content.joints),
            "roles": dict(analysis.roles),
            "effects": list(analysis.effects),
            "observer": analysis.observer,
            "bandwidth": analysis.bandwidth,
            "refine": analysis.refine,
        },
        "staircase": [
            {
                "added": list(one.added),
                "rms": list(one.model.step.rms),
                "rms_validation": _list(one.model.step.rms_validation),
                "noise_floor": list(one.model.step.noise_floor),
                "verdict": one.model.step.verdict,
            }
            for one in content.rounds
        ],
        "groups": [
            {"name": name, "used_to": used, "rms": values}
            for name, used, values in (group_rows(content.steps) if content.steps else ())
        ],
        "added": [
            {"effect": name, "finding": None if finding is None else finding.to_json()}
            for name, finding in content.added
        ],
        "diagnosis": diagnosis,
        "identification": None if content.identification is None else content.identification.to_json(),
        "guard": _guard(content.diagnosis.guard if content.diagnosis is not None else None),
        "next_experiments": next_experiments(content, found),
        "history": [{"when": s.when, "label": s.label, "flexviz": s.version} for s in content.session.steps],
        "notes": [{"when": note.when, "text": note.text} for note in content.session.notes],
        "recordings": [str(file) for file in content.session.recordings],
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
