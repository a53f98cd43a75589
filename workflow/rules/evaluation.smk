"""Errors of every regressor on held-out frames (Lips16 6): take by take, then all takes together.

The studio alone writes truth; besides it, only this file names it, and only its rules read it.
"""


def truth_files(take, names=("vertices_mm.npy", "triangles.npy")):
    """Files of a take's known truth; none where there is none."""
    take = take_of(take)
    if take.source == STUDIO:
        folder = Path(fill(P.truth, take))
    elif CONFIG.evaluation.truth:
        folder = Path(CONFIG.evaluation.truth) / take.name
    else:
        return []
    files = [folder / name for name in names]
    known = take.source == STUDIO or all(path.is_file() for path in files)
    return [str(path) for path in files] if known else []


def neutral_truth_files(subject):
    """Truth of the take whose first frame is the subject's neutral, in the world of H."""
    neutral = takes("tattoo", subject)
    return truth_files(neutral[0]) if neutral else []


def has_truth(take):
    """Whether a take can be followed in known truth: it has one, and so has the neutral."""
    return bool(truth_files(take) and neutral_truth_files(take.subject))


def evaluated_takes():
    """Takes with held-out frames of people with a correspondence, and with truth or H."""
    people = set(subjects("tattoo"))
    return [
        take
        for take in takes(("tattoo", "video"))
        if take.test_frames() and take.subject in people
        if take.role == "tattoo" or has_truth(take)
    ]


def reconstructed_takes():
    """Takes whose H can be held against known truth."""
    return [take for take in takes("tattoo") if has_truth(take)]


def evaluated_models(subject):
    """Model files to measure on a person's takes: their PS, MS, the GR without them, variants."""
    options = CONFIG.evaluation
    names = regressors_of(subject, trained_subjects())
    variants = with_variants(names, options.variants, options.variants_of)
    return expand(P.model, regressor=variants)


def all_evaluated_models():
    """Model files that some take is measured with."""
    people = dict.fromkeys(take.subject for take in evaluated_takes())
    return list(dict.fromkeys(path for person in people for path in evaluated_models(person)))


def evaluate_inputs(wildcards):
    """Inputs that depend on the role of the take and on whether its truth is known."""
    take = take_of(wildcards)
    generic = [CONFIG.evaluation.generic] if CONFIG.evaluation.generic else []
    inputs = {"models": evaluated_models(take.subject) + generic}
    if take.role == "tattoo":
        inputs["layers"] = of_chunks(P.layers, take)
    if has_truth(take):
        neutral = takes("tattoo", take.subject)[0]
        inputs["truth"] = truth_files(take)
        if curves := truth_files(take, ["weights.json"]):
            inputs["curves"] = curves[0]
        inputs["neutral_truth"] = neutral_truth_files(take.subject)
        inputs["neutral_accurate"] = of_chunks(P.accurate, neutral)[0]
    else:
        inputs["accurate"] = of_chunks(P.accurate, take)
    return inputs


def takes_that_train():
    """Tattoo takes with training frames."""
    return [take for take in takes("tattoo") if take.train_frames()]


def error_image(path, caption, subcategory, what=""):
    """An image of a take's errors that Snakemake's report shows."""
    return in_report(path, "Errors", caption, subcategory, take="{subject}/{take}" + what)


rule lip_shapes:
    """Chooses lip shapes of the training takes for the contour baseline: lip_shapes.npz."""
    input:
        tracker=base_model,
        correspondence=expand(P.correspondence, subject=trained_subjects()),
        accurate=of_takes(P.accurate, takes_that_train()),
        accurate_quality=of_takes(P.multiview_quality, takes_that_train()),
        drift=of_takes(P.drift, takes_that_train()),
        neutrals=of_takes(P.neutral, takes_that_train()),
    output:
        shapes=P.lip_shapes,
    log:
        P.log("lip_shapes", "run"),
    benchmark:
        P.benchmark("lip_shapes", "run")
    resources:
        mem_mb=growing(3000),
        runtime=growing(30),
    params:
        cfg=cfg_of("evaluation.contour", "multiview.lost"),
        code=code_of("evaluation/lip_shapes"),
        subjects=trained_subjects(),
        takes=[
            {
                "take": take.name,
                "train": take.train_frames(),
                "chunks": len(chunks(take)),
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
        template=P.template,
        correspondence=P.correspondence,
        identity=P.identity,
        neutral_pair=lambda wildcards: neutral_pair_of(wildcards.subject),
        shapes=P.lip_shapes,
        fit=P.fit,
        coarse=per_chunk(P.coarse),
        features=per_chunk(P.features),
    output:
        measures=P.evaluated + "/measures.tsv",
        seconds=P.evaluated + "/seconds.tsv",
        sums=P.evaluated + "/sums.npz",
        frames=P.evaluated + "/frames.tsv",
        maps=P.evaluated + "/maps.npz",
        quality=P.evaluated + "/quality.tsv",
    log:
        P.log("evaluate", "take"),
    benchmark:
        P.benchmark("evaluate", "take")
    resources:
        mem_mb=growing(3000),
        runtime=growing(20, for_each_frame=0.05),
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
        first=first_frame,
        fps=take_fps,
    script:
        "../scripts/evaluation/evaluate.py"


rule evaluate_reconstruction:
    """Measures H itself against known truth: surface error, vertex error, drift."""
    input:
        template=P.template,
        correspondence=P.correspondence,
        cameras=P.cameras,
        accurate=per_chunk(P.accurate),
        truth=truth_files,
    output:
        measures=P.reconstructed + "/measures.tsv",
        sums=P.reconstructed + "/sums.npz",
    log:
        P.log("evaluate_reconstruction", "take"),
    benchmark:
        P.benchmark("evaluate_reconstruction", "take")
    resources:
        mem_mb=growing(3000),
        runtime=growing(20, for_each_frame=0.05),
    params:
        cfg=cfg_of("evaluation.reference", "evaluation.measures"),
        code=code_of("evaluation/evaluate_reconstruction"),
        first=first_frame,
    script:
        "../scripts/evaluation/evaluate_reconstruction.py"


def studied_takes():
    """Rows of the takes whose true frames train and predict each other (Guided18 6.2)."""
    return [_TAKES[name] for name in CONFIG.guided.study.takes]


def studied_truth(wildcards):
    """The true sequence of a take with its face model and neutral: the studio's, else H."""
    take = take_of(wildcards)
    if take.source == STUDIO:
        truth = fill(P.truth, take)
        return {
            "sequence": [truth + "/vertices_mm.npy"],
            "neutral": truth + "/neutral_mm.npy",
            "face": P.studio_model,
        }
    return {
        "sequence": of_chunks(P.accurate, take),
        "neutral": fill(P.neutral, take),
        "face": P.template,
    }


rule guided_evaluate:
    """Trains guided correction with few true frames, predicts all others (Guided18 6.2, figure 11)."""
    input:
        unpack(studied_truth),
    output:
        measures=P.guided_measures,
        figure=error_image(P.guided_figure, "figure11", "Guided correction"),
        sheet=error_image(P.guided_sheet, "figure12", "Guided correction", ", maps"),
    log:
        P.log("guided_evaluate", "take"),
    benchmark:
        P.benchmark("guided_evaluate", "take")
    resources:
        mem_mb=growing(4000),
        runtime=growing(20, for_each_frame=0.05),
    params:
        cfg=cfg_of("guided.regions", "guided.study", "evaluation.measures"),
        code=code_of("evaluation/guided_evaluate"),
    script:
        "../scripts/evaluation/guided_evaluate.py"


rule evaluation_figures:
    """Renders, surface stretch and errors from front and side, curves over time (fig. 9 to 16)."""
    input:
        images=mono_images,
        maps=P.evaluated + "/maps.npz",
        frames=P.evaluated + "/frames.tsv",
    output:
        maps=error_image(P.evaluated + "/error_maps.png", "error_maps", "Error maps"),
        renders=error_image(P.evaluated + "/renders.png", "renders", "Renders"),
        stretch=error_image(P.evaluated + "/stretch.png", "stretch", "Surface stretch"),
        curves=error_image(P.evaluated + "/curves.png", "curves", "Over time"),
    log:
        P.log("evaluation_figures", "take"),
    benchmark:
        P.benchmark("evaluation_figures", "take")
    resources:
        mem_mb=growing(1500),
        runtime=growing(20),
    params:
        cfg=cfg_of("evaluation.figures"),
        code=code_of("evaluation/evaluation_figures"),
        source=mono_source,
        camera=mono_camera,
    script:
        "../scripts/evaluation/evaluation_figures.py"


rule measures:
    """Joins the measures of all takes, and the takes together: measures.tsv, table1.tsv."""
    input:
        takes=of_takes(P.evaluated + "/sums.npz", evaluated_takes()),
        seconds=of_takes(P.evaluated + "/seconds.tsv", evaluated_takes()),
        frames=of_takes(P.evaluated + "/frames.tsv", evaluated_takes()),
        reconstructions=of_takes(P.reconstructed + "/sums.npz", reconstructed_takes()),
        curves=[path.replace(".h5", ".cv.tsv") for path in all_evaluated_models()],
        tables=of_takes(P.evaluated + "/measures.tsv", evaluated_takes())
        + of_takes(P.reconstructed + "/measures.tsv", reconstructed_takes())
        + of_takes(P.guided_measures, studied_takes()),
    output:
        measures=in_report(P.measures, "Tables", "measures", table="all measures"),
        kinds=in_report(P.kinds, "Tables", "kinds", table="kinds of mouth shapes"),
        seconds=P.seconds,
        comparisons=P.comparisons,
        headline=in_report(P.headline, "Tables", "headline", table="headline"),
        table2=P.table2,
        table3=P.table3,
        estimators=P.estimators,
        table1=in_report(P.table1, "Tables", "table1", table="table 1"),
        figure16=in_report(
            P.figure16,
            "Errors",
            "figure16",
            subcategory="Over time",
            take="RBF network against affine map",
        ),
        image=in_report(P.table1_figure, "Tables", "table1", table="table 1, image"),
    log:
        P.log("measures", "run"),
    benchmark:
        P.benchmark("measures", "run")
    resources:
        mem_mb=growing(1500),
        runtime=growing(20),
    params:
        cfg=cfg_of("evaluation.measures", "training.regressor"),
        code=code_of("evaluation/measures"),
        takes=[{"take": take.name, "role": take.role} for take in evaluated_takes()],
    script:
        "../scripts/evaluation/measures.py"
