"""The page of a corrected take: video beside result, time line of warnings, files to take away."""

import os
from pathlib import Path

import numpy as np

from vermilion.export.page_video import page_video
from vermilion.faces.model import FaceModel
from vermilion.features.rings import lip_rings
from vermilion.provenance.begun_run import begin_job
from vermilion.report.lips_page import TakeFile, TakePage, take_page
from vermilion.storage.files import write_text
from vermilion.storage.sequences import read_sequence
from vermilion.storage.tables import read_table
from vermilion.tracking.result import TrackedTake

#: Input -> what the file is, and what opens it.
FILES = {
    "usd": "the corrected mesh, animated: Blender (File > Import > Universal Scene Description), Maya, Unreal, "
    "Houdini",
    "albedo": "the skin's texture, which the mesh files name: copy it with them",
    "usd_shapes": "the same as blend shapes (UsdSkel)",
    "gltf": "the same as morph targets: Blender, Unity, web browsers",
    "alembic": "the same as Alembic",
    "live_link": "ARKit's 52 weights of the corrected face, as Live Link Face writes them",
    "rig": "weights of your rig for the corrected face",
    "weights": "weights of the track, before correction, by the face model's shape names; for corrected ARKit "
    "weights set apply.export.live_link: true",
    "overlay": "original, track and result side by side",
    "corrected": "the corrected vertices of all frames: NumPy (frames, vertices, 3), mm",
    "mesh": "the triangles to these vertices",
    "quality": "every flagged frame with its reason",
}
#: Explains each kind of reason; from the project's folder.
GUIDE = "docs/howto/bad_take.md"


def opening_of(face, sequence, valid):
    """Distance of the lips at their middle in each frame, (F,) mm; NaN where not tracked."""
    ring = lip_rings(face, 40)[1]
    points = ring.points(np.asarray(sequence, dtype=np.float64))
    opening = np.linalg.norm(points[:, 10] - points[:, 30], axis=1)
    return np.where(valid, opening, np.nan)


def main(snakemake):
    inputs, params = snakemake.input, snakemake.params
    subject, take = snakemake.wildcards.subject, snakemake.wildcards.take
    fit, face = TrackedTake.load(inputs.fit), FaceModel.load(inputs.tracker)
    flagged = read_table(inputs.quality)
    own = (flagged["subject"].astype(str) == subject) & (flagged["take"].astype(str) == take)
    folder = Path(snakemake.output.page).parent
    files = [
        TakeFile(os.path.relpath(inputs[name], folder), Path(inputs[name]).stat().st_size, what)
        for name, what in FILES.items()
        if inputs.get(name)
    ]
    found = TakePage(
        title=take if params.only else f"{subject}/{take}",
        frames=fit.frames,
        fps=params.fps,
        face_model=params.face_model,
        correction=params.correction,
        video=page_video(inputs.overlay, params.fps),
        opening_mm=opening_of(face, read_sequence(inputs.corrected), fit.valid),
        flagged=flagged[own],
        files=files,
        configuration=params.configuration,
        track=os.path.relpath(Path(inputs.track).parent, folder),
        guide=os.path.relpath(GUIDE, folder) if Path(GUIDE).is_file() else "",
    )
    write_text(snakemake.output.page, take_page(found))


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
