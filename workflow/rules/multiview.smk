"""H, the registered high-quality mesh sequence of a rig's take (Lips16 3.1, Beeler et al. 2011).

The take is cut into clips of about `multiview.track.clip_frames`: anchors are jobs of their own, then
clips between anchors, then chunks of frames; each kind runs side by side.
"""

from vermilion.multiview.anchors import anchor_window, n_clips


wildcard_constraints:
    clip=r"\d{4}",


def clips_of(wildcards):
    """Indices of the clips of the wildcards' take."""
    row = take_of(wildcards)
    return range(n_clips(row.first, row.last, CONFIG.multiview.track.clip_frames))


def per_clip(pattern, first=0):
    """Input function: `pattern` for every clip of the wildcards' take from `first` on."""
    return lambda wildcards: [
        fill(pattern, wildcards, clip=f"{clip:04d}") for clip in clips_of(wildcards)[first:]
    ]


def window_of(wildcards):
    """Frames among which an anchor is sought."""
    row = take_of(wildcards)
    size = CONFIG.multiview.track.clip_frames
    return list(anchor_window(row.first, row.last, size, int(wildcards.clip)))


def window_images(wildcards):
    """Inputs of a job that opens captured images of an anchor's window and of the neutral."""
    wanted = {take_of(wildcards).first, *window_of(wildcards)}
    names = [name for name in chunks(wildcards) if wanted & set(frames_in(name))]
    return images_of(wildcards, names, sorted(wanted))


def first_take(wildcards):
    """The take whose points of the skin this one's vertices mark too; None: it is the first."""
    found = takes("tattoo", wildcards.subject)
    if not found or found[0].take == wildcards.take or not CONFIG.multiview.neutral.same_points:
        return None
    return found[0]


def first_neutral(wildcards):
    """Neutral, cameras and images of the person's first take, for the later ones (`unpack`)."""
    first = first_take(wildcards)
    if first is None:
        return {}
    return {
        "first_neutral": fill(P.neutral, first),
        "first_cameras": fill(P.cameras, first),
        "first_manifest": captured_neutral(first),
    }


def first_place(wildcards):
    """Name, frame and source of that take, and how it is registered; empty for the first."""
    first = first_take(wildcards)
    if first is None:
        return {}
    return {
        "take": first.take,
        "frame": first.first,
        "source": source_of(first),
        "cfg": cfg_of("multiview.refine"),
    }


rule multiview_neutral:
    """Registers the template to the take's first frame: neutral.npz and its cloud (Lips16 3.1)."""
    input:
        unpack(first_neutral),
        template=P.template,
        cameras=P.cameras,
        landmarks=P.views_neutral,
        manifest=captured_neutral,
    output:
        neutral=P.neutral,
        cloud=P.neutral_cloud,
        surface=P.neutral_surface,
        overlay=P.neutral_overlay,
    log:
        P.log("multiview_neutral", "take"),
    benchmark:
        P.benchmark("multiview_neutral", "take")
    resources:
        mem_mb=growing(1500, for_rig=30),
        runtime=growing(30, for_rig=0.1),
    params:
        cfg=cfg_of("multiview.images", "multiview.stereo", "multiview.neutral"),
        code=code_of("multiview/multiview_neutral"),
        source=source_of,
        frame=first_frame,
        first=first_place,
    script:
        "../scripts/multiview/multiview_neutral.py"


rule multiview_anchor:
    """Registers the frame of a window that looks most like the neutral to it: anchors/{clip}.npz."""
    input:
        template=P.template,
        cameras=P.cameras,
        neutral=P.neutral,
        manifests=window_images,
    output:
        anchor=P.anchor,
    log:
        P.log("multiview_anchor", "clip"),
    benchmark:
        P.benchmark("multiview_anchor", "clip")
    resources:
        mem_mb=growing(1500, for_rig=30),
        runtime=growing(30),
    params:
        cfg=cfg_of("multiview.images", "multiview.track"),
        code=code_of("multiview/multiview_anchor"),
        source=source_of,
        neutral=first_frame,
        window=window_of,
    script:
        "../scripts/multiview/multiview_anchor.py"


rule multiview_clip:
    """Tracks the frames between two anchors coarsely, forward and backward: clips/{clip}.npz."""
    input:
        template=P.template,
        cameras=P.cameras,
        neutral=P.neutral,
        anchors=per_clip(P.anchor, first=1),
        manifests=captured_take,
    output:
        clip=P.clip,
    log:
        P.log("multiview_clip", "clip"),
    benchmark:
        P.benchmark("multiview_clip", "clip")
    resources:
        mem_mb=growing(1500, for_rig=30),
        runtime=growing(60, for_rig_frames=0.005),
    params:
        cfg=cfg_of("multiview.images", "multiview.track"),
        code=code_of("multiview/multiview_clip"),
        source=source_of,
        frames=take_span,
    script:
        "../scripts/multiview/multiview_clip.py"


rule multiview_track:
    """Joins the clips of a take: track.npz."""
    input:
        template=P.template,
        neutral=P.neutral,
        anchors=per_clip(P.anchor, first=1),
        clips=per_clip(P.clip),
    output:
        track=P.track,
        topology=P.accurate_topology,
    log:
        P.log("multiview_track", "take"),
    benchmark:
        P.benchmark("multiview_track", "take")
    resources:
        mem_mb=growing(2000),
        runtime=growing(10),
    params:
        code=code_of("multiview/multiview_track"),
    script:
        "../scripts/multiview/multiview_track.py"


rule multiview_refine:
    """Registers each frame of a chunk to the neutral's images: H/{chunk}.npy (Lips16 3.1)."""
    input:
        template=P.template,
        cameras=P.cameras,
        neutral=P.neutral,
        track=P.track,
        first_manifest=captured_neutral,
        manifest=captured_chunk,
    output:
        meshes=P.accurate,
        visibility=P.visibility,
        quality=P.multiview_quality,
        overlay=P.multiview_overlay,
    log:
        P.log("multiview_refine", "chunk"),
    benchmark:
        P.benchmark("multiview_refine", "chunk")
    resources:
        mem_mb=growing(1500, for_rig=75),
        runtime=growing(60, for_rig_frames=0.02),
    params:
        cfg=cfg_of("multiview.images", "multiview.stereo", "multiview.refine"),
        code=code_of("multiview/multiview_refine"),
        source=source_of,
        neutral=first_frame,
        frames=chunk_frames,
    script:
        "../scripts/multiview/multiview_refine.py"


rule multiview_drift:
    """Compares each frame of a chunk with the neutral's images, carried by the mesh: drift/{chunk}.tsv."""
    input:
        template=P.template,
        cameras=P.cameras,
        neutral=P.neutral,
        meshes=P.accurate,
        first_manifest=captured_neutral,
        manifest=captured_chunk,
    output:
        drift=P.drift,
    log:
        P.log("multiview_drift", "chunk"),
    benchmark:
        P.benchmark("multiview_drift", "chunk")
    resources:
        mem_mb=growing(1500, for_rig=30),
        runtime=growing(30, for_rig_frames=0.003),
    params:
        cfg=cfg_of("multiview.images", "multiview.drift"),
        code=code_of("multiview/multiview_drift"),
        source=source_of,
        neutral=first_frame,
        frames=chunk_frames,
    script:
        "../scripts/multiview/multiview_drift.py"


def if_tracked(pattern):
    """Input function: `pattern`, for every chunk, of a take with H; nothing of a neutral alone."""
    return lambda wildcards: (
        of_takes(pattern, [wildcards]) if take_of(wildcards).role == "tattoo" else []
    )


rule multiview_report:
    """Shows how well each frame of a take is known, and where to look: report.html, drift.tsv."""
    input:
        template=P.template,
        cameras=P.cameras,
        neutral=P.neutral,
        first_manifest=captured_neutral,
        manifests=lambda wildcards: (
            captured_take(wildcards) if take_of(wildcards).role == "tattoo" else []
        ),
        track=if_tracked(P.track),
        meshes=if_tracked(P.accurate),
        visibility=if_tracked(P.visibility),
        quality=if_tracked(P.multiview_quality),
        drift=if_tracked(P.drift),
    output:
        page=in_report(
            P.multiview_page, "Reconstruction", "reconstruction", take="{subject}/{take}"
        ),
        drift=P.drift_table,
    log:
        P.log("multiview_report", "take"),
    benchmark:
        P.benchmark("multiview_report", "take")
    resources:
        mem_mb=growing(2000, for_rig=50),
        runtime=growing(30),
    params:
        cfg=cfg_of(
            "multiview.images",
            "multiview.stereo",
            "multiview.refine",
            "multiview.drift",
            "multiview.report",
        ),
        code=code_of("multiview/multiview_report"),
        source=source_of,
        neutral=first_frame,
    script:
        "../scripts/multiview/multiview_report.py"
