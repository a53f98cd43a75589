"""Errors of every regressor on held-out frames, take by take (Lips16 6): evaluation/takes/.

The only rules that read truth.
"""


rule lip_shapes:
    """Chooses lip shapes of the training takes for the contour baseline: lip_shapes.npz."""
    input:
        tracker=R + "/face/tracker.npz",
        correspondence=[f"{R}/subjects/{name}/correspondence.npz" for name in trained_subjects()],
        accurate=of_training_chunks("multiview/H/{chunk}.npy"),
        accurate_quality=of_training_chunks("multiview/quality/{chunk}.tsv"),
        neutrals=of_takes(R + "/takes/{subject}/{take}/multiview/neutral.npz", takes_that_train()),
    output:
        shapes=R + "/evaluation/lip_shapes.npz",
    log:
        R + "/logs/lip_shapes.log",
    benchmark:
        R + "/benchmarks/lip_shapes.tsv"
    resources:
        mem_mb=3000,
        runtime=30,
    params:
        cfg=cfg_of("evaluation.contour"),
        code=code_of("evaluation/lip_shapes"),
        subjects=trained_subjects(),
        takes=[
            {
                "take": take.name,
                "train": take.train_frames(),
                "chunks": len(chunks(take.subject, take.take)),
            }
            for take in takes_that_train()
        ],
    script:
        "../scripts/evaluation/lip_shapes.py"


rule evaluate:
    """Applies every regressor to the held-out frames of a take and measures: measures.tsv."""
    input:
        unpack(evaluate_inputs),
        unpack(neutral_of_take),
        tracker=tracker_of,
        template=R + "/face/template.npz",
        correspondence=R + "/subjects/{subject}/correspondence.npz",
        identity=R + "/subjects/{subject}/identity.npz",
        neutral_pair=lambda wildcards: neutral_pair_of(wildcards.subject),
        shapes=R + "/evaluation/lip_shapes.npz",
        fit=R + "/takes/{subject}/{take}/tracking/fit.npz",
        coarse=per_chunk(R + "/takes/{subject}/{take}/tracking/C/{chunk}.npy"),
        features=per_chunk(R + "/takes/{subject}/{take}/correction/features/{chunk}.npz"),
    output:
        measures=EVALUATED + "/measures.tsv",
        seconds=EVALUATED + "/seconds.tsv",
        sums=EVALUATED + "/sums.npz",
        frames=EVALUATED + "/frames.tsv",
        maps=EVALUATED + "/maps.npz",
        quality=EVALUATED + "/quality.tsv",
    log:
        R + "/logs/evaluate/{subject}-{take}.log",
    benchmark:
        R + "/benchmarks/evaluate/{subject}-{take}.tsv"
    resources:
        mem_mb=3000,
        runtime=120,
    params:
        cfg=cfg_of(
            "evaluation.reference",
            "evaluation.measures",
            "evaluation.contour",
            "evaluation.figures.map_frames",
            "correction.integration",
            "correction.image",
        ),
        code=code_of("evaluation/evaluate"),
        frames=lambda wildcards: take_of(wildcards).test_frames(),
        first=lambda wildcards: take_of(wildcards).first,
        fps=lambda wildcards: take_of(wildcards).fps,
    script:
        "../scripts/evaluation/evaluate.py"


rule evaluate_reconstruction:
    """Measures H itself against known truth: surface error, vertex error, drift."""
    input:
        template=R + "/face/template.npz",
        correspondence=R + "/subjects/{subject}/correspondence.npz",
        cameras=R + "/takes/{subject}/{take}/cameras",
        accurate=per_chunk(R + "/takes/{subject}/{take}/multiview/H/{chunk}.npy"),
        truth=lambda wildcards: truth_files(wildcards.subject, wildcards.take),
    output:
        measures=RECONSTRUCTED + "/measures.tsv",
        sums=RECONSTRUCTED + "/sums.npz",
    log:
        R + "/logs/evaluate_reconstruction/{subject}-{take}.log",
    benchmark:
        R + "/benchmarks/evaluate_reconstruction/{subject}-{take}.tsv"
    resources:
        mem_mb=3000,
        runtime=120,
    params:
        cfg=cfg_of("evaluation.reference", "evaluation.measures"),
        code=code_of("evaluation/evaluate_reconstruction"),
        first=lambda wildcards: take_of(wildcards).first,
    script:
        "../scripts/evaluation/evaluate_reconstruction.py"


rule evaluation_figures:
    """Renders, surface stretch and errors from front and side, curves over time (fig. 9 to 16)."""
    input:
        images=mono_images,
        maps=EVALUATED + "/maps.npz",
        frames=EVALUATED + "/frames.tsv",
    output:
        maps=report(
            EVALUATED + "/error_maps.png",
            category="Errors",
            subcategory="Error maps",
            labels={"take": "{subject}/{take}"},
            caption="../report/error_maps.rst",
        ),
        renders=report(
            EVALUATED + "/renders.png",
            category="Errors",
            subcategory="Renders",
            labels={"take": "{subject}/{take}"},
            caption="../report/renders.rst",
        ),
        stretch=report(
            EVALUATED + "/stretch.png",
            category="Errors",
            subcategory="Surface stretch",
            labels={"take": "{subject}/{take}"},
            caption="../report/stretch.rst",
        ),
        curves=report(
            EVALUATED + "/curves.png",
            category="Errors",
            subcategory="Over time",
            labels={"take": "{subject}/{take}"},
            caption="../report/curves.rst",
        ),
    log:
        R + "/logs/evaluation_figures/{subject}-{take}.log",
    benchmark:
        R + "/benchmarks/evaluation_figures/{subject}-{take}.tsv"
    resources:
        mem_mb=1500,
        runtime=20,
    params:
        cfg=cfg_of("evaluation.figures"),
        code=code_of("evaluation/evaluation_figures"),
        source=mono_sources,
        camera=mono_camera,
    script:
        "../scripts/evaluation/evaluation_figures.py"
