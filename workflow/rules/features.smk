"""Features for the regressor (Lips16 5.1): shape coefficients and relative contour distances."""


rule features:
    """Measures the contours from the coarse meshes of a chunk: features/{chunk}.npz (F, M)."""
    input:
        unpack(mono_inputs),
        # Everybody's model, also for those with a scan: shape features have one basis for all people.
        model=R + "/face/tracker.npz",
        identity=R + "/subjects/{subject}/identity.npz",
        fit=R + "/takes/{subject}/{take}/tracking/fit.npz",
        coarse=R + "/takes/{subject}/{take}/tracking/C/{chunk}.npy",
        maps=R + "/takes/{subject}/{take}/contours/{chunk}",
    output:
        features=R + "/takes/{subject}/{take}/correction/features/{chunk}.npz",
        quality=R + "/takes/{subject}/{take}/correction/features/quality/{chunk}.tsv",
        overlay=R + "/takes/{subject}/{take}/correction/features/overlay/{chunk}.png",
    log:
        R + "/logs/features/{subject}-{take}-{chunk}.log",
    benchmark:
        R + "/benchmarks/features/{subject}-{take}-{chunk}.tsv"
    resources:
        mem_mb=1000,
        runtime=30,
    params:
        cfg=cfg_of("features.shape", "features.contours"),
        code=code_of("features/features"),
        source=mono_source,
        camera=mono_camera,
        frames=lambda wildcards: frames_in(wildcards.chunk),
    script:
        "../scripts/features/features.py"
