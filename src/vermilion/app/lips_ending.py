"""What `vermilion lips` says when it has ended: what was used, what to look at, what to take away."""

from __future__ import annotations

from pathlib import Path

from vermilion.app.face_files import ModelChoice
from vermilion.config.apply import NO_REGRESSOR, ApplyConfig
from vermilion.config.takes import Take
from vermilion.report.lips_page import frames_with_warnings
from vermilion.storage.tables import read_table


def ending(results: Path, take: Take, face: ModelChoice, model: Path | None) -> list[str]:
    """Lines for the terminal.

    Args:
        results: folder of the run.
        take: the clip.
        face: its face model.
        model: file of the regressor; None: contours alone.
    """
    folder = results / "apply" / take.subject / take.take
    file = None if model is None else str(model)
    section = ApplyConfig.model_validate({"regressor": NO_REGRESSOR, "model": file})
    corrected_by = section.corrected_by(face.section["name"], take.subject)
    lines = [f"Face model: {face.name}", f"Correction: {corrected_by}"]
    quality = results / "quality.tsv"
    if quality.is_file():
        flagged = read_table(quality)
        own = flagged[flagged["take"].astype(str) == take.take]
        lines.append(frames_with_warnings(own, take.last - take.first + 1))
    if (page := folder / "lips.html").is_file():
        lines.append(f"Look at: {page} (open in a browser)")
    if (usd := folder / "corrected.usdc").is_file():
        texture = "; copy albedo.png with it" if (folder / "albedo.png").is_file() else ""
        lines.append(f"For Blender: {usd} (File > Import > Universal Scene Description{texture})")
    return lines
