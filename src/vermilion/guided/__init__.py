"""User-guided lip correction (Guided18): correct a few frames, and the take follows.

Everything takes arrays, meshes and cameras, in a notebook as in the workflow. In the order of the
paper:

- `regions`: which triangles are predicted (inner lips) and which are trusted (mouth region), from a
  face model's labels or from vertex lists (section 4, figure 2). `GuidedRegions`, `regions_of_face`,
  `regions_of_vertices`.
- `gradients`: deformation gradients against the neutral. `NeutralTriangles`.
- `reduced_regression`: trusted to predicted gradients by the k x k system (section 4).
  `ReducedRegression`.
- `dirichlet`: gradients back to vertices, the border held. `GradientIntegrator`.
- `propagation`: the three together, with alignment, contact and a file: train on k corrected frames,
  correct a sequence. `LipPropagator`.
- `suggestion`: frames worth correcting; uniform, random and extreme ones beside (section 7).
  `suggest_frames`.
- `sketch`: what a person draws on an image, and its JSON file. `Sketch`, `read_sketch`,
  `write_sketch`.
- `curves`: samples of strokes, lips that press.
- `silhouette`: where a mesh's lip contours are in a camera. `LipSurface`.
- `refinement`: a frame moved onto its sketches (section 5, eq. 1). `SketchRefiner`.
- `contact`: lips that do not pass through each other; volumes of the lips. `separate_lips`,
  `LipVolumes`.
- `constrained_energy`: few linear constraints beside a factored energy, for refinement and contact.
  `ConstrainedEnergy`.

A take in a notebook:

    regions = regions_of_face(face)
    refiner = SketchRefiner(regions, LipSurface.of_face(face, regions))
    corrected = refiner.refine(mesh_mm, [(read_sketch(path), camera)]).vertices_mm
    propagator = LipPropagator(neutral_mm, regions, stable).fit(corrected_meshes_mm)
    result = propagator.correct(sequence_mm).vertices_mm
"""

from vermilion.guided.contact import LipVolumes, separate_lips
from vermilion.guided.dirichlet import GradientIntegrator
from vermilion.guided.gradients import NeutralTriangles
from vermilion.guided.propagation import LipPropagator, Propagation
from vermilion.guided.reduced_regression import ReducedRegression
from vermilion.guided.refinement import (
    SMOOTH,
    Refined,
    RefinementSettings,
    SketchRefiner,
)
from vermilion.guided.regions import GuidedRegions, regions_of_face, regions_of_vertices
from vermilion.guided.silhouette import LipSurface
from vermilion.guided.sketch import (
    Sketch,
    SketchCurve,
    read_sketch,
    sketch_of_json,
    sketch_path,
    sketch_paths,
    write_sketch,
)
from vermilion.guided.suggestion import (
    extreme_frames,
    mouth_deformation,
    random_frames,
    suggest_frames,
    unexplained_share,
    uniform_frames,
)

__all__ = [
    "SMOOTH",
    "GradientIntegrator",
    "GuidedRegions",
    "LipPropagator",
    "LipSurface",
    "LipVolumes",
    "NeutralTriangles",
    "Propagation",
    "ReducedRegression",
    "Refined",
    "RefinementSettings",
    "Sketch",
    "SketchCurve",
    "SketchRefiner",
    "extreme_frames",
    "mouth_deformation",
    "random_frames",
    "read_sketch",
    "regions_of_face",
    "regions_of_vertices",
    "separate_lips",
    "sketch_of_json",
    "sketch_path",
    "sketch_paths",
    "suggest_frames",
    "unexplained_share",
    "uniform_frames",
    "write_sketch",
]
