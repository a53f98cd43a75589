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
        pattern.format(subject=wildcards.subject, take=wildcards.take, clip=f"{clip:04d}")
        for clip in clips_of(wildcards)[first:]
    ]


def window_of(wildcards):
    """Frames among which an anchor is sought."""
    row = take_of(wildcards)
    size = CONFIG.multiview.track.clip_frames
    return list(anchor_window(row.first, row.last, size, int(wildcards.clip)))


def window_manifests(wildcards):
    """Manifests of the chunks that hold an anchor's window, and the neutral's."""
    wanted = {take_of(wildcards).first, *window_of(wildcards)}
    pattern = R + "/takes/{subject}/{take}/capture/{chunk}.json"
    files = expand_chunks(pattern, wildcards.subject, wildcards.take)
    names = chunks(wildcards.subject, wildcards.take)
    return [path for path, name in zip(files, names) if wanted & set(frames_in(name))]


ANCHORS = R + "/takes/{subject}/{take}/multiview/anchors/{clip}.npz"
CLIPS = R + "/takes/{subject}/{take}/multiview/clips/{clip}.npz"


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
    folder = f"{R}/takes/{first.subject}/{first.take}"
    return {
        "first_neutral": f"{folder}/multiview/neutral.npz",
        "first_cameras": f"{folder}/cameras",
        "first_manifest": f"{folder}/capture/{chunks(first.subject, first.take)[0]}.json",
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
        template=R + "/face/template.npz",
        cameras=R + "/takes/{subject}/{take}/cameras",
        landmarks=R + "/takes/{subject}/{take}/landmarks/views_neutral.npz",
        manifest=first_chunk(R + "/takes/{subject}/{take}/capture/{chunk}.json"),
    output:
        neutral=R + "/takes/{subject}/{take}/multiview/neutral.npz",
        cloud=R + "/takes/{subject}/{take}/multiview/cloud_neutral.ply",
        surface=R + "/takes/{subject}/{take}/multiview/surface_neutral.ply",
        overlay=R + "/takes/{subject}/{take}/multiview/overlay/neutral.png",
    log:
        R + "/logs/multiview_neutral/{subject}-{take}.log",
    benchmark:
        R + "/benchmarks/multiview_neutral/{subject}-{take}.tsv"
    resources:
        mem_mb=1500,
        runtime=30,
    params:
        cfg=cfg_of("multiview.images", "multiview.stereo", "multiview.neutral"),
        code=code_of("multiview/multiview_neutral"),
        source=source_of,
        frame=lambda wildcards: take_of(wildcards).first,
        first=first_place,
    script:
        "../scripts/multiview/multiview_neutral.py"


rule multiview_anchor:
    """Registers the frame of a window that looks most like the neutral to it: anchors/{clip}.npz."""
    input:
        template=R + "/face/template.npz",
        cameras=R + "/takes/{subject}/{take}/cameras",
        neutral=R + "/takes/{subject}/{take}/multiview/neutral.npz",
        manifests=window_manifests,
    output:
        anchor=ANCHORS,
    log:
        R + "/logs/multiview_anchor/{subject}-{take}-{clip}.log",
    benchmark:
        R + "/benchmarks/multiview_anchor/{subject}-{take}-{clip}.tsv"
    resources:
        mem_mb=1500,
        runtime=30,
    params:
        cfg=cfg_of("multiview.images", "multiview.track"),
        code=code_of("multiview/multiview_anchor"),
        source=source_of,
        neutral=lambda wildcards: take_of(wildcards).first,
        window=window_of,
    script:
        "../scripts/multiview/multiview_anchor.py"


rule multiview_clip:
    """Tracks the frames between two anchors coarsely, forward and backward: clips/{clip}.npz."""
    input:
        template=R + "/face/template.npz",
        cameras=R + "/takes/{subject}/{take}/cameras",
        neutral=R + "/takes/{subject}/{take}/multiview/neutral.npz",
        anchors=per_clip(ANCHORS, first=1),
        manifests=per_chunk(R + "/takes/{subject}/{take}/capture/{chunk}.json"),
    output:
        clip=CLIPS,
    log:
        R + "/logs/multiview_clip/{subject}-{take}-{clip}.log",
    benchmark:
        R + "/benchmarks/multiview_clip/{subject}-{take}-{clip}.tsv"
    resources:
        mem_mb=1500,
        runtime=60,
    params:
        cfg=cfg_of("multiview.images", "multiview.track"),
        code=code_of("multiview/multiview_clip"),
        source=source_of,
        frames=lambda wildcards: [take_of(wildcards).first, take_of(wildcards).last],
    script:
        "../scripts/multiview/multiview_clip.py"


rule multiview_track:
    """Joins the clips of a take: track.npz."""
    input:
        template=R + "/face/template.npz",
        neutral=R + "/takes/{subject}/{take}/multiview/neutral.npz",
        anchors=per_clip(ANCHORS, first=1),
        clips=per_clip(CLIPS),
    output:
        track=R + "/takes/{subject}/{take}/multiview/track.npz",
        topology=R + "/takes/{subject}/{take}/multiview/H/topology.ply",
    log:
        R + "/logs/multiview_track/{subject}-{take}.log",
    benchmark:
        R + "/benchmarks/multiview_track/{subject}-{take}.tsv"
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        code=code_of("multiview/multiview_track"),
    script:
        "../scripts/multiview/multiview_track.py"


rule multiview_refine:
    """Registers each frame of a chunk to the neutral's images: H/{chunk}.npy (Lips16 3.1)."""
    input:
        template=R + "/face/template.npz",
        cameras=R + "/takes/{subject}/{take}/cameras",
        neutral=R + "/takes/{subject}/{take}/multiview/neutral.npz",
        track=R + "/takes/{subject}/{take}/multiview/track.npz",
        first_manifest=first_chunk(R + "/takes/{subject}/{take}/capture/{chunk}.json"),
        manifest=R + "/takes/{subject}/{take}/capture/{chunk}.json",
    output:
        meshes=R + "/takes/{subject}/{take}/multiview/H/{chunk}.npy",
        visibility=R + "/takes/{subject}/{take}/multiview/visibility/{chunk}.npy",
        quality=R + "/takes/{subject}/{take}/multiview/quality/{chunk}.tsv",
        overlay=R + "/takes/{subject}/{take}/multiview/overlay/{chunk}.png",
    log:
        R + "/logs/multiview_refine/{subject}-{take}-{chunk}.log",
    benchmark:
        R + "/benchmarks/multiview_refine/{subject}-{take}-{chunk}.tsv"
    resources:
        mem_mb=1500,
        runtime=60,
    params:
        cfg=cfg_of("multiview.images", "multiview.stereo", "multiview.refine"),
        code=code_of("multiview/multiview_refine"),
        source=source_of,
        neutral=lambda wildcards: take_of(wildcards).first,
        frames=lambda wildcards: frames_in(wildcards.chunk),
    script:
        "../scripts/multiview/multiview_refine.py"


rule multiview_drift:
    """Compares each frame of a chunk with the neutral's images, carried by the mesh: drift/{chunk}.tsv."""
    input:
        template=R + "/face/template.npz",
        cameras=R + "/takes/{subject}/{take}/cameras",
        neutral=R + "/takes/{subject}/{take}/multiview/neutral.npz",
        meshes=R + "/takes/{subject}/{take}/multiview/H/{chunk}.npy",
        first_manifest=first_chunk(R + "/takes/{subject}/{take}/capture/{chunk}.json"),
        manifest=R + "/takes/{subject}/{take}/capture/{chunk}.json",
    output:
        drift=R + "/takes/{subject}/{take}/multiview/drift/{chunk}.tsv",
    log:
        R + "/logs/multiview_drift/{subject}-{take}-{chunk}.log",
    benchmark:
        R + "/benchmarks/multiview_drift/{subject}-{take}-{chunk}.tsv"
    resources:
        mem_mb=1500,
        runtime=30,
    params:
        cfg=cfg_of("multiview.images", "multiview.drift"),
        code=code_of("multiview/multiview_drift"),
        source=source_of,
        neutral=lambda wildcards: take_of(wildcards).first,
        frames=lambda wildcards: frames_in(wildcards.chunk),
    script:
        "../scripts/multiview/multiview_drift.py"


def if_tracked(pattern):
    """Input function: `pattern`, for every chunk, of a take with H; nothing of a neutral alone."""
    return lambda wildcards: (
        list(dict.fromkeys(per_chunk(pattern)(wildcards)))
        if take_of(wildcards).role == "tattoo"
        else []
    )


rule multiview_report:
    """Shows how well each frame of a take is known, and where to look: report.html, drift.tsv."""
    input:
        template=R + "/face/template.npz",
        cameras=R + "/takes/{subject}/{take}/cameras",
        neutral=R + "/takes/{subject}/{take}/multiview/neutral.npz",
        first_manifest=first_chunk(R + "/takes/{subject}/{take}/capture/{chunk}.json"),
        manifests=if_tracked(R + "/takes/{subject}/{take}/capture/{chunk}.json"),
        track=if_tracked(R + "/takes/{subject}/{take}/multiview/track.npz"),
        meshes=if_tracked(R + "/takes/{subject}/{take}/multiview/H/{chunk}.npy"),
        visibility=if_tracked(R + "/takes/{subject}/{take}/multiview/visibility/{chunk}.npy"),
        quality=if_tracked(R + "/takes/{subject}/{take}/multiview/quality/{chunk}.tsv"),
        drift=if_tracked(R + "/takes/{subject}/{take}/multiview/drift/{chunk}.tsv"),
    output:
        page=report(
            R + "/takes/{subject}/{take}/multiview/report.html",
            category="Reconstruction",
            labels={"take": "{subject}/{take}"},
            caption="../report/reconstruction.rst",
        ),
        drift=R + "/takes/{subject}/{take}/multiview/drift.tsv",
    log:
        R + "/logs/multiview_report/{subject}-{take}.log",
    benchmark:
        R + "/benchmarks/multiview_report/{subject}-{take}.tsv"
    resources:
        mem_mb=2000,
        runtime=30,
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
        neutral=lambda wildcards: take_of(wildcards).first,
    script:
        "../scripts/multiview/multiview_report.py"
