"""Where the library repeats a default of the configuration: settings classes and keywords."""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Pair:
    """Where the defaults of a settings class stand in the configuration.

    Attributes:
        sections: the first one with a key of the field's name counts.
        renamed: field -> key, where the names differ.
        unset: field -> why no configuration sets it.
    """

    sections: tuple[str, ...]
    renamed: dict[str, str] = field(default_factory=dict)
    unset: dict[str, str] = field(default_factory=dict)


#: Settings class (module.Class) -> its sections.
CLASSES = {
    "capture.board.Board": Pair(
        ("capture.calibration",),
        {"legacy": "capture.calibration.legacy_pattern"},
        {"marker_mm": "a checkerboard has no markers"},
    ),
    "capture.calibrate.CalibrationSettings": Pair(("capture.calibration",)),
    "capture.rig_poses.RigRefinementSettings": Pair(("capture.refinement",)),
    "capture.tracks.FeatureMatchSettings": Pair(("capture.refinement",)),
    "contours.boosting.BoostingSettings": Pair(
        ("contours.detector.boosting", "contours.detector"),
        {"n_trees": "contours.detector.boosting.trees"},
    ),
    "contours.boosted.BoostedDetector": Pair(("contours.detector",)),
    "contours.ridges.RidgeDetector": Pair(
        ("contours.detector",),
        {
            "width": "contours.detector.ridge_width",
            "reach": "contours.detector.ridge_reach",
        },
    ),
    "contours.track_ridge.TrackRidgeDetector": Pair(
        ("contours.detector.track", "contours.detector"),
        {
            "width": "contours.detector.ridge_width",
            "reach": "contours.detector.track.inner_reach",
        },
    ),
    "contours.training.ContourTrainingSettings": Pair(
        ("contours.detector",), {"n_features": "contours.detector.features"}
    ),
    "detail.flow.deformation.DeformationSettings": Pair(("detail.deformation",)),
    "detail.flow.six_frame_flow.FlowSettings": Pair(("detail.flow",)),
    "detail.relief.relief.ReliefSettings": Pair(("detail.relief",)),
    "evaluation.lips.LipTolerances": Pair(("evaluation.measures",)),
    "features.search.SearchSettings": Pair(
        ("features.contours",),
        {"outward": "features.contours.reach", "inward": "features.contours.reach"},
        {"floor": "keeps the logarithm of a likelihood finite"},
    ),
    "inpaint.frame.InpaintInputs": Pair(("inpaint.composite", "inpaint.domain", "inpaint.shading")),
    "inpaint.opening.OpeningSettings": Pair(("inpaint.opening",)),
    "inpaint.shading.ShadingSettings": Pair(("inpaint.shading",)),
    "landmarks.correction.LandmarkCorrectionSettings": Pair(
        ("landmarks.correction",),
        unset={"fill_confidence": "confidence of a landmark that no frame detected"},
    ),
    "landmarks.following.FaceChoice": Pair(
        ("landmarks.following",),
        unset={
            "point_px": "no number of the key `face`: the largest",
            "box_px": "no number of the key `face`: the largest",
        },
    ),
    "landmarks.key_frames.KeyFrameSettings": Pair(("landmarks.key_frames",)),
    "landmarks.networks.NetworkSettings": Pair(("landmarks.networks",)),
    "landmarks.training.LandmarkTrainingSettings": Pair(("landmarks.training",)),
    "multiview.refine.FrameMatchSettings": Pair(("multiview.refine",)),
    "regression.training.Selection": Pair(("training",)),
    "studio.render.Scene": Pair(("studio",)),
    "tracking.identity.colour_residuals.IdentityImageSettings": Pair(("tracking.identity.images",)),
    "tracking.identity.landmark_identity.IdentitySettings": Pair(
        ("tracking.identity",),
        unset={
            "iterations": "a bound that no fit reaches",
            "bias.robust_sigmas": "the bias is a Gaussian prior",
        },
    ),
    "tracking.image_fit.frame_fit.FrameFitSettings": Pair(("tracking.image_fit.frame_fit",)),
    "tracking.landmark_fit.expression.LandmarkFitSettings": Pair(
        ("tracking.fit", "tracking.motion"),
        unset={"tolerance_mm": "a bound below what anyone measures"},
    ),
    "tracking.landmark_fit.observation.LandmarkNoise": Pair(("tracking.fit.noise", "tracking.fit")),
    "tracking.offsets.OffsetSettings": Pair(("tracking.offsets",)),
}

#: Classes with a number as a default that no configuration sets.
WITHOUT_SECTION = {
    "app.run_progress.RunProgress": "what is known of a run before it says anything",
    "faces.procedural_layout.Layout": "the mesh of the procedural head, not a setting of users",
    "geometry.registration.Schedule": "by default the search distance stays; scans shrink it",
    "guided.prior_refinement.HandNoise": "how strokes err; a sketch has no configuration",
    "guided.refinement.RefinementSettings": "Guided18's weights; a sketch has no configuration",
    "imaging.colour.VideoColour": "what a video without tags has: sRGB primaries",
    "imaging.presentation.Presentation": "what a video without tags has: square pixels, no HDR",
    "landmarks.binary_patterns.PatternSettings": "Mono13's constants for likeness of frames",
    "multiview.motion.SolveSettings": "rounds and tolerance of an iterative solve that converges",
    "multiview.neutral.Neutral": "a result: the first take's neutral has not moved",
}

#: Function (module.function or module.Class.method) -> keyword -> key with the same default.
FUNCTIONS = {
    "capture.bundle_adjust.bundle_adjust": {"shift_mm": "capture.refinement.shift_mm"},
    "capture.manifest.capture_manifest": {"hash_decoded": "capture.manifest.hash_decoded"},
    "capture.patches.align_patches": {"radius_px": "capture.refinement.patch_radius_px"},
    "contours.training.train_detector": {"seed": "contours.detector.seed"},
    "correction.domain.integration_domain": {"seam_mm": "correction.integration.seam_mm"},
    "correction.integration.LayerIntegrator": {"seam_mm": "correction.integration.seam_mm"},
    "database.write.write_database": {
        "min_common_mask": "database.min_common_mask",
        "compression": "database.compression",
    },
    "faces.ict.template_model": {"slight_open": "face_model.template_slight_open"},
    "faces.ict.tracker_model": {
        "n_triangles": "face_model.tracker_triangles",
        "slight_open": "face_model.template_slight_open",
    },
    "faces.procedural.studio_model": {
        "spacing_mm": "face_model.studio_spacing_mm",
        "seed": "face_model.seed",
    },
    "faces.procedural.template_model": {
        "slight_open": "face_model.template_slight_open",
        "spacing_mm": "face_model.template_spacing_mm",
    },
    "faces.procedural.tracker_model": {
        "n_triangles": "face_model.tracker_triangles",
    },
    "features.tracked_lips.TrackedLips.of": {"n_samples": "features.contours.samples"},
    "inpaint.bake.bake": {"edge_mm": "inpaint.domain.edge_mm"},
    "inpaint.tattoo.tattoo_mask": {"closing_mm": "inpaint.mask.closing_mm"},
    "landmarks.flow.FaceFlow": {"face_px": "landmarks.correction.face_px"},
    "landmarks.table.read_landmark_csv": {
        "pixel_centre": "landmarks.files.pixel_centre",
        "min_confidence": "landmarks.files.min_confidence",
    },
    "landmarks.point_file.read_point_file": {
        "pixel_centre": "landmarks.files.pixel_centre",
        "min_confidence": "landmarks.files.min_confidence",
    },
    "multiview.photometric.motion_at": {"min_agreement": "multiview.track.min_agreement"},
    "multiview.photometric.measure_motion": {"min_agreement": "multiview.track.min_agreement"},
    "regression.cross_validation.cross_validate": {"n_folds": "training.folds"},
    "regression.kernel.KernelRegressor": {
        "linear": "training.kernel_linear",
        "fade": "training.fade",
        "equalise": "training.kernel_equalise",
    },
    "scan.personal.personal_model": {"finest_mm": "scan:finest_mm"},
    "studio.lighting.bake_light": {
        "n_directions": "studio.occlusion_directions",
        "n_points": "studio.light_samples",
    },
    "studio.live_link.read_live_link": {
        "csv_first": "studio_take:csv_first",
        "csv_fps": "studio_take:csv_fps",
    },
    "studio.performance.generated_weights": {
        "intensity": "studio.intensity",
        "n_poses": "studio_take:poses",
        "pose_seconds": "studio_take:pose_seconds",
    },
}  # fmt: skip
