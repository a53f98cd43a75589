"""Our labels on the topology of another tracker: its neutral with our face model laid over it."""

from vermilion.external.overlay import topology_overlay
from vermilion.external.topology import label_topology, unregistered
from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import Mesh
from vermilion.geometry.mesh_files import read_mesh
from vermilion.imaging.images import write_srgb8
from vermilion.landmarks.choose import open_detector
from vermilion.provenance.begun_run import begin_job
from vermilion.scan.landmarks import find_landmarks, read_scan_landmarks, write_scan_landmarks
from vermilion.storage.chunks import read_frames
from vermilion.storage.errors import InputError


def neutral_of(inputs, frame, place):
    """The mesh of the neutral frame, the tracker's own world, mm."""
    vertices = read_frames([inputs.coarse], [frame])[0].astype(float)
    if not (abs(vertices) < float("inf")).all():
        raise unregistered("no mesh", **place)
    return Mesh(vertices, read_mesh(inputs.topology).triangles)


def landmarks_of(snakemake, generic, mesh, given, place):
    """Landmarks on the neutral: given by hand, or detected in rendered views."""
    if given:
        return read_scan_landmarks(given, place["subject"])
    cfg = snakemake.params.cfg
    detector = open_detector(
        cfg["landmarks.detector"], snakemake.params.model, cfg["landmarks.networks"]
    )
    try:
        return find_landmarks(mesh, detector, generic.neutral_mm[generic.landmarks])
    except InputError as error:
        raise unregistered(error.brief, **place) from error


def main(snakemake):
    inputs, output, cfg = snakemake.input, snakemake.output, snakemake.params.cfg
    frame = snakemake.params.frame
    place = {**snakemake.params.take, "frame": frame}
    generic, mesh = FaceModel.load(inputs.tracker), neutral_of(inputs, frame, place)
    landmarks = landmarks_of(snakemake, generic, mesh, inputs.get("landmarks"), place)
    write_scan_landmarks(output.landmarks, landmarks)
    found = label_topology(
        generic, mesh, landmarks, least_opening=-cfg["face_model.template_slight_open"], **place
    )
    print(found.made.figures())
    write_srgb8(output.overlay, topology_overlay(found))
    found.model.save(output.topology)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
