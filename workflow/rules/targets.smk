"""What a finished run has: named in full, so that a lost file of any stage is made again.

Snakemake does not miss an intermediate file as long as what follows from it exists. Each job is
therefore wanted through its first output; `verify` removes all outputs of a job together.
"""

from vermilion.provenance.cleaning import cleaned

#: Roles -> outputs of a take: those with {chunk} are wanted for every chunk.
TAKE_OUTPUTS = {
    ("tattoo", "plain", "video"): (P.manifest, P.cameras),
    ("tattoo", "plain"): (P.views_neutral, P.neutral, P.multiview_page),
    ("tattoo",): (P.track, P.accurate, P.drift, P.tattoo_reference, P.inpainted, P.layers),
    TRACKED_ROLES: (
        P.landmarks,
        P.fit,
        P.coarse_topology,
        P.coarse,
        P.contour_detector,
        P.maps,
        P.features,
    ),
}


def take_outputs():
    """Files and folders of the stages of every take that is used."""
    return [
        path
        for roles, patterns in TAKE_OUTPUTS.items()
        for pattern in patterns
        for path in of_takes(pattern, used_takes(roles))
    ]


def clip_outputs():
    """Anchors and clips of every take with H."""
    return [
        path
        for take in used_takes("tattoo")
        for pattern, first in ((P.anchor, 1), (P.clip, 0))
        for path in per_clip(pattern, first)(take)
    ]


def subject_outputs():
    """Files of every subject of the database, and identities of all that are tracked."""
    tracked = list(dict.fromkeys(take.subject for take in used_takes(TRACKED_ROLES)))
    imaged = [] if EXTERNAL else [s for s in tracked if s in image_identity_subjects()]
    return [
        *expand(P.identity, subject=tracked),
        *expand(P.identity_overlay, subject=imaged),
        *expand(P.plain_texture, subject=subjects("tattoo")),
        *expand(P.correspondence, subject=subjects("tattoo")),
        *of_takes(P.neutral_pair, neutral_takes()),
    ]


def evaluation_outputs():
    """Measures and figures of every take that is measured."""
    rows = evaluated_takes()
    return (
        of_takes(P.evaluated + "/measures.tsv", rows)
        + of_takes(P.evaluated + "/error_maps.png", rows)
        + of_takes(P.reconstructed + "/measures.tsv", reconstructed_takes())
    )


def study_outputs():
    """What is learnt and measured: nothing of that is made where no take has an accurate mesh."""
    return [
        P.database,
        *regressor_outputs(),
        *evaluation_outputs(),
        P.measures,
        *([P.ablations] if ablation_tables() else []),
        P.summary,
    ]


def all_outputs():
    """All that a finished run has, without intermediate results that were removed on purpose."""
    gone = {str(path) for path in cleaned(Path(R))}
    return [path for path in every_output() if path not in gone]


def every_output():
    """All that a finished run has."""
    landmark_model = [P.landmark_model] if DETECTOR == "trained" else []
    return [
        *studio_outputs(),
        P.tracker,
        *landmark_model,
        *take_outputs(),
        *clip_outputs(),
        *subject_outputs(),
        *detail_outputs(),
        *(study_outputs() if database_takes() else []),
        *of_takes(P.apply_overlay, applied_takes()),
        *of_takes(P.corrected, applied_takes()),
        *of_takes(P.lips_page, applied_takes()),
        *guided_outputs(),
        *of_takes(P.guided_measures, studied_takes()),
        *(of_takes(P.makeup, applied_takes()) if CONFIG.apply.makeup.enabled else []),
        P.quality,
    ]
