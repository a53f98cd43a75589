"""H, the registered high-quality mesh sequence of a rig's take (Lips16 3.1, Beeler et al. 2011)."""


rule multiview_neutral:
    """Registers the template to the take's first frame: neutral.npz and its cloud (Lips16 3.1)."""
    input:
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
        code=code_of("multiview_neutral"),
        source=source_of,
        frame=lambda wildcards: take_of(wildcards).first,
    script:
        "../scripts/multiview_neutral.py"


rule multiview_track:
    """Tracks the neutral's mesh coarsely through the take, from anchor frames: track.npz."""
    input:
        template=R + "/face/template.npz",
        cameras=R + "/takes/{subject}/{take}/cameras",
        neutral=R + "/takes/{subject}/{take}/multiview/neutral.npz",
        manifests=per_chunk(R + "/takes/{subject}/{take}/capture/{chunk}.json"),
    output:
        track=R + "/takes/{subject}/{take}/multiview/track.npz",
        topology=R + "/takes/{subject}/{take}/multiview/H/topology.ply",
    log:
        R + "/logs/multiview_track/{subject}-{take}.log",
    benchmark:
        R + "/benchmarks/multiview_track/{subject}-{take}.tsv"
    resources:
        mem_mb=1500,
        runtime=240,
    params:
        cfg=cfg_of("multiview.images", "multiview.track"),
        code=code_of("multiview_track"),
        source=source_of,
        frames=lambda wildcards: [take_of(wildcards).first, take_of(wildcards).last],
    script:
        "../scripts/multiview_track.py"


rule multiview_refine:
    """Registers each frame of a chunk to the neutral's pictures: H/{chunk}.npy (Lips16 3.1)."""
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
        code=code_of("multiview_refine"),
        source=source_of,
        neutral=lambda wildcards: take_of(wildcards).first,
        frames=lambda wildcards: frames_in(wildcards.chunk),
    script:
        "../scripts/multiview_refine.py"
