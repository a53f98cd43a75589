"""The coarse sequence C (Lips16 3.2, Mono13 6): who it is, then pose and blend weights."""

TRACKED_ROLES = ("tattoo", "video")


def external_takes(wildcards=None):
    """Regular expression of the takes that bring their own meshes (none: matches nothing)."""
    names = sorted({take.take.replace(".", r"\.") for take in takes("tracked")})
    return "|".join(names) or "(?!)"


def identity_takes(wildcards):
    """The takes of a subject that landmarks are found in."""
    found = takes(TRACKED_ROLES, wildcards.subject)
    if not found:
        raise WorkflowError(
            f"subject {wildcards.subject}: found no take of role {' or '.join(TRACKED_ROLES)}; "
            f"expected one to track. Add it to {CONFIG.takes}."
        )
    return found


def of_identity_takes(pattern):
    """Input function: `pattern` for every take of a subject, and every chunk where it has them."""

    def inputs(wildcards):
        paths = []
        for take in identity_takes(wildcards):
            if "{chunk}" in pattern:
                paths += expand_chunks(pattern, take.subject, take.take)
            else:
                paths.append(pattern.format(subject=take.subject, take=take.take))
        return paths

    return inputs


def sampled_takes(wildcards):
    """What the identity's script is told of each take of a subject."""
    return [
        {
            "take": t.take,
            "camera": mono_camera(t),
            "neutral": t.first if t.is_multiview else None,
            "chunks": len(chunks(t.subject, t.take)),
        }
        for t in identity_takes(wildcards)
    ]


def imaged_subjects():
    """Subjects whose identity images tell of: a model that a scan gave has none to choose from."""
    if not CONFIG.tracking.identity.images.enabled:
        return set()
    return {take.subject for take in takes(TRACKED_ROLES)} - set(CONFIG.tracking.scans)


def from_images():
    """Regular expression of these subjects (none: matches nothing)."""
    names = sorted(subject.replace(".", r"\.") for subject in imaged_subjects())
    return "|".join(names) or "(?!)"


rule identity:
    """Finds the person in landmarks of frames of all takes: subjects/{subject}/identity.npz."""
    input:
        tracker=tracker_of,
        landmarks=of_identity_takes(R + "/takes/{subject}/{take}/landmarks/{chunk}.npz"),
        cameras=of_identity_takes(R + "/takes/{subject}/{take}/cameras"),
        calibration=of_identity_takes(R + "/takes/{subject}/{take}/capture/cameras.json"),
    output:
        identity=R + "/subjects/{subject}/identity.npz",
    log:
        R + "/logs/identity/{subject}.log",
    benchmark:
        R + "/benchmarks/identity/{subject}.tsv"
    resources:
        mem_mb=1500,
        runtime=30,
    params:
        cfg=cfg_of("tracking.fit", "tracking.identity"),
        code=code_of("tracking/identity"),
        takes=sampled_takes,
    script:
        "../scripts/tracking/identity.py"


rule image_identity:
    """Finds the person in landmarks and images together: subjects/{subject}/identity.npz."""
    input:
        tracker=tracker_of,
        landmarks=of_identity_takes(R + "/takes/{subject}/{take}/landmarks/{chunk}.npz"),
        cameras=of_identity_takes(R + "/takes/{subject}/{take}/cameras"),
        calibration=of_identity_takes(R + "/takes/{subject}/{take}/capture/cameras.json"),
        images=lambda wildcards: [
            path for take in identity_takes(wildcards) for path in mono_images(take)
        ],
    output:
        identity=R + "/subjects/{subject}/identity.npz",
        overlay=R + "/subjects/{subject}/overlay/identity.png",
    log:
        R + "/logs/image_identity/{subject}.log",
    benchmark:
        R + "/benchmarks/image_identity/{subject}.tsv"
    wildcard_constraints:
        subject=from_images(),
    resources:
        mem_mb=1500,
        runtime=30,
    params:
        cfg=cfg_of("tracking.fit", "tracking.identity"),
        code=code_of("tracking/image_identity"),
        takes=lambda wildcards: [
            row | {"source": mono_sources(take)}
            for row, take in zip(sampled_takes(wildcards), identity_takes(wildcards))
        ],
    script:
        "../scripts/tracking/image_identity.py"


ruleorder: image_identity > identity


def landmark_fit(wildcards=None):
    """Where the fit to the landmarks lies: beside the refined one, or in its place."""
    name = "landmark_fit" if CONFIG.refinement.photometric else "fit"
    return R + f"/takes/{{subject}}/{{take}}/tracking/{name}.npz"


def mesh_offsets(wildcards):
    """Input of the meshes: offsets of a chunk that a refinement adds to the model's vertices."""
    if not CONFIG.refinement.layer:
        return {}
    return {"offsets": R + "/takes/{subject}/{take}/tracking/offsets/{chunk}.npy"}


rule tracking:
    """Fits pose and blend weights of a whole take to its landmarks."""
    input:
        tracker=tracker_of,
        identity=R + "/subjects/{subject}/identity.npz",
        landmarks=per_chunk(R + "/takes/{subject}/{take}/landmarks/{chunk}.npz"),
        cameras=R + "/takes/{subject}/{take}/cameras",
    output:
        fit=landmark_fit(),
    log:
        R + "/logs/tracking/{subject}-{take}.log",
    benchmark:
        R + "/benchmarks/tracking/{subject}-{take}.tsv"
    resources:
        mem_mb=lambda wildcards: 1000 + 2 * len(take_of(wildcards).frames),
        runtime=60,
    params:
        cfg=cfg_of("tracking.fit", "tracking.motion"),
        code=code_of("tracking/tracking"),
        camera=mono_camera,
        fps=lambda wildcards: take_of(wildcards).fps,
    script:
        "../scripts/tracking/tracking.py"


rule tracking_meshes:
    """Writes C of a chunk in the world, and the model over the images: tracking/C/{chunk}.npy."""
    input:
        unpack(mono_inputs),
        unpack(mesh_offsets),
        tracker=tracker_of,
        identity=R + "/subjects/{subject}/identity.npz",
        fit=R + "/takes/{subject}/{take}/tracking/fit.npz",
        landmarks=R + "/takes/{subject}/{take}/landmarks/{chunk}.npz",
    output:
        meshes=R + "/takes/{subject}/{take}/tracking/C/{chunk}.npy",
        quality=R + "/takes/{subject}/{take}/tracking/quality/{chunk}.tsv",
        overlay=R + "/takes/{subject}/{take}/tracking/overlay/{chunk}.png",
    log:
        R + "/logs/tracking_meshes/{subject}-{take}-{chunk}.log",
    benchmark:
        R + "/benchmarks/tracking_meshes/{subject}-{take}-{chunk}.tsv"
    resources:
        mem_mb=1500,
        runtime=60,
    params:
        cfg=cfg_of("tracking.meshes"),
        code=code_of("tracking/tracking_meshes"),
        source=mono_source,
        frames=lambda wildcards: frames_in(wildcards.chunk),
    script:
        "../scripts/tracking/tracking_meshes.py"


rule tracking_topology:
    """Writes the triangles of C beside its chunks: tracking/C/topology.ply."""
    input:
        tracker=tracker_of,
        identity=R + "/subjects/{subject}/identity.npz",
    output:
        R + "/takes/{subject}/{take}/tracking/C/topology.ply",
    log:
        R + "/logs/tracking_topology/{subject}-{take}.log",
    benchmark:
        R + "/benchmarks/tracking_topology/{subject}-{take}.tsv"
    localrule: True
    resources:
        mem_mb=500,
        runtime=10,
    params:
        code=code_of("tracking/tracking_topology"),
    script:
        "../scripts/tracking/tracking_topology.py"


rule tracked_meshes:
    """Reads C of a take that another tracker made (role `tracked`)."""
    input:
        source=source_of,
    output:
        meshes=R + "/takes/{subject}/{take}/tracking/C/{chunk}.npy",
    log:
        R + "/logs/tracked_meshes/{subject}-{take}-{chunk}.log",
    benchmark:
        R + "/benchmarks/tracked_meshes/{subject}-{take}-{chunk}.tsv"
    wildcard_constraints:
        take=external_takes(),
    resources:
        mem_mb=1500,
        runtime=30,
    params:
        cfg=cfg_of("tracking.external"),
        code=code_of("tracking/tracked_meshes"),
        frames=lambda wildcards: frames_in(wildcards.chunk),
    script:
        "../scripts/tracking/tracked_meshes.py"


rule tracked_topology:
    """Writes the triangles of a sequence that another tracker made (role `tracked`)."""
    input:
        source=source_of,
    output:
        R + "/takes/{subject}/{take}/tracking/C/topology.ply",
    log:
        R + "/logs/tracked_topology/{subject}-{take}.log",
    benchmark:
        R + "/benchmarks/tracked_topology/{subject}-{take}.tsv"
    wildcard_constraints:
        take=external_takes(),
    localrule: True
    resources:
        mem_mb=1500,
        runtime=30,
    params:
        cfg=cfg_of("tracking.external"),
        code=code_of("tracking/tracked_topology"),
        first=lambda wildcards: take_of(wildcards).first,
    script:
        "../scripts/tracking/tracked_topology.py"


ruleorder: tracked_meshes > tracking_meshes
ruleorder: tracked_topology > tracking_topology
