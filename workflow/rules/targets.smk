"""What a finished run has: named in full, so that a lost file of any stage is made again.

Snakemake does not miss an intermediate file as long as what follows from it exists. Each job is
therefore wanted through its first output; `verify` removes all outputs of a job together.
"""

#: Role -> outputs a take: those with {chunk} are wanted for every chunk.
TAKE_OUTPUTS = {
    ("tattoo", "plain", "video"): ("capture/{chunk}.json", "cameras"),
    ("tattoo", "plain"): (
        "landmarks/views_neutral.npz",
        "multiview/neutral.npz",
        "multiview/report.html",
    ),
    ("tattoo",): (
        "multiview/track.npz",
        "multiview/H/{chunk}.npy",
        "multiview/drift/{chunk}.tsv",
        "inpaint/reference.exr",
        "inpaint/{chunk}",
        "correction/layers/{chunk}.npz",
    ),
    ("tattoo", "video"): (
        "landmarks/{chunk}.npz",
        "tracking/fit.npz",
        "tracking/C/topology.ply",
        "tracking/C/{chunk}.npy",
        "contours/detector.npz",
        "contours/{chunk}",
        "correction/features/{chunk}.npz",
    ),
}


def take_outputs():
    """Files and folders of the stages of every take that is used."""
    return [
        path
        for roles, names in TAKE_OUTPUTS.items()
        for take in used_takes(roles)
        for name in names
        for path in dict.fromkeys(
            expand_chunks(R + "/takes/{subject}/{take}/" + name, take.subject, take.take)
        )
    ]


def clip_outputs():
    """Anchors and clips of every take with H."""
    return [
        path
        for take in used_takes("tattoo")
        for pattern, first in ((ANCHORS, 1), (CLIPS, 0))
        for path in per_clip(pattern, first)(take)
    ]


def subject_outputs():
    """Files of every subject of the database, and identities of all that are tracked."""
    tracked = dict.fromkeys(take.subject for take in used_takes(("tattoo", "video")))
    paths = [f"{R}/subjects/{subject}/identity.npz" for subject in tracked]
    paths += [
        f"{R}/subjects/{subject}/overlay/identity.png"
        for subject in tracked
        if subject in imaged_subjects()
    ]
    for subject in subjects("tattoo"):
        paths.append(f"{R}/subjects/{subject}/plain_texture.exr")
        paths.append(f"{R}/subjects/{subject}/correspondence.npz")
    return paths + of_takes(NEUTRAL_PAIR, neutral_takes())


def evaluation_outputs():
    """Measures and figures of every take that is measured."""
    rows = evaluated_takes()
    return (
        of_takes(EVALUATED + "/measures.tsv", rows)
        + of_takes(EVALUATED + "/error_maps.png", rows)
        + of_takes(RECONSTRUCTED + "/measures.tsv", reconstructed_takes())
    )


def all_outputs():
    """All that a finished run has."""
    landmark_model = [LANDMARK_MODEL] if CONFIG.landmarks.detector == "trained" else []
    return [
        *studio_outputs(),
        f"{R}/face/tracker.npz",
        *landmark_model,
        *take_outputs(),
        *clip_outputs(),
        *subject_outputs(),
        *detail_outputs(),
        *shading_outputs(),
        R + "/database/lips.h5",
        *regressor_outputs(),
        *evaluation_outputs(),
        R + "/evaluation/measures.tsv",
        *[f"{R}/apply/{name}/overlay.mp4" for name in applied_takes()],
        *[
            path
            for name in applied_takes()
            for path in expand_chunks(APPLIED + "/chunks/{chunk}.npy", *name.split("/"))
        ],
        *[
            f"{R}/apply/{name}/makeup.mp4"
            for name in applied_takes()
            if CONFIG.apply.makeup.enabled
        ],
        *([R + "/evaluation/ablations.tsv"] if ablation_tables() else []),
        R + "/quality.tsv",
        R + "/evaluation/summary.html",
    ]
