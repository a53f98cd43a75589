"""Features for the regressor (Lips16 5.1): shape coefficients and relative contour distances."""


rule features:
    """Measures the contours from the coarse meshes of a chunk: features/{chunk}.npz (F, M)."""
    input:
        images=chunk_images,
        # Everybody's model, also for those with a scan: shape features have one basis for all people.
        model=base_model,
        identity=P.identity,
        fit=P.fit,
        coarse=P.coarse,
        maps=P.maps,
        landmarks=P.landmarks,
    output:
        features=P.features,
        quality=P.features_quality,
        overlay=P.features_overlay,
    log:
        P.log("features", "chunk"),
    benchmark:
        P.benchmark("features", "chunk")
    resources:
        mem_mb=growing(1000, for_mono=60),
        runtime=growing(30),
    params:
        cfg=cfg_of("features.shape", "features.contours"),
        code=code_of("features/features"),
        source=chunk_source,
        camera=mono_camera,
        frames=chunk_frames,
    script:
        "../scripts/features/features.py"
