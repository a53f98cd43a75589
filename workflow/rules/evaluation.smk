"""Errors of every regressor on held-out frames (Lips16 6): evaluation/measures.tsv, table1.tsv.

The only rules that read truth.
"""


def truth_files(subject, take):
    """Vertices and triangles of a take's known truth; none where there is none."""
    if _TAKES[f"{subject}/{take}"].source == STUDIO:
        folder = Path(R) / "truth" / subject / take
    elif CONFIG.evaluation.truth:
        folder = Path(CONFIG.evaluation.truth) / subject / take
    else:
        return []
    files = [folder / "vertices_mm.npy", folder / "triangles.npy"]
    known = _TAKES[f"{subject}/{take}"].source == STUDIO or all(path.is_file() for path in files)
    return [str(path) for path in files] if known else []


def curve_files(take):
    """The true expression weights of a take; none where they are not known."""
    if take.source == STUDIO:
        return [f"{R}/truth/{take.name}/weights.json"]
    if not CONFIG.evaluation.truth:
        return []
    path = Path(CONFIG.evaluation.truth) / take.name / "weights.json"
    return [str(path)] if path.is_file() else []


def neutral_truth_files(subject):
    """Truth of the take whose first frame is the subject's neutral, in the world of H."""
    neutral = takes("tattoo", subject)
    return truth_files(subject, neutral[0].take) if neutral else []


def has_truth(take):
    """Whether a take can be followed in known truth: it has one, and so has the neutral."""
    return bool(truth_files(take.subject, take.take) and neutral_truth_files(take.subject))


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
    return [
        f"{R}/models/{name}.h5"
        for name in with_variants(names, options.variants, options.variants_of)
    ]


def evaluate_inputs(wildcards):
    """Inputs that depend on the role of the take and on whether its truth is known."""
    take = take_of(wildcards)
    folder = f"{R}/takes/{take.subject}/{take.take}"
    inputs = {"models": evaluated_models(take.subject)}
    if take.role == "tattoo":
        pattern = folder + "/correction/layers/{chunk}.npz"
        inputs["layers"] = expand_chunks(pattern, take.subject, take.take)
    if has_truth(take):
        neutral = takes("tattoo", take.subject)[0].take
        pattern = R + "/takes/{subject}/{take}/multiview/H/{chunk}.npy"
        inputs["truth"] = truth_files(take.subject, take.take)
        if curve_files(take):
            inputs["curves"] = curve_files(take)[0]
        inputs["neutral_truth"] = neutral_truth_files(take.subject)
        inputs["neutral_accurate"] = expand_chunks(pattern, take.subject, neutral)[0]
    else:
        pattern = folder + "/multiview/H/{chunk}.npy"
        inputs["accurate"] = expand_chunks(pattern, take.subject, take.take)
    return inputs


def of_takes(pattern, rows):
    """`pattern` for each of some takes."""
    return [pattern.format(subject=take.subject, take=take.take) for take in rows]


EVALUATED = R + "/evaluation/takes/{subject}/{take}"
RECONSTRUCTED = R + "/evaluation/reconstruction/{subject}/{take}"


def takes_that_train():
    """Tattoo takes with training frames."""
    return [take for take in takes("tattoo") if take.train_frames()]


def of_training_chunks(pattern):
    """`pattern` for every chunk of every training take."""
    return [
        path
        for take in takes_that_train()
        for path in expand_chunks(R + "/takes/{subject}/{take}/" + pattern, take.subject, take.take)
    ]


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
        code=code_of("evaluation_lip_shapes"),
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
        "../scripts/evaluation_lip_shapes.py"


rule evaluate:
    """Applies every regressor to the held-out frames of a take and measures: measures.tsv."""
    input:
        unpack(evaluate_inputs),
        tracker=tracker_of,
        template=R + "/face/template.npz",
        correspondence=R + "/subjects/{subject}/correspondence.npz",
        identity=R + "/subjects/{subject}/identity.npz",
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
        ),
        code=code_of("evaluate"),
        frames=lambda wildcards: take_of(wildcards).test_frames(),
        first=lambda wildcards: take_of(wildcards).first,
    script:
        "../scripts/evaluate.py"


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
        code=code_of("evaluate_reconstruction"),
        first=lambda wildcards: take_of(wildcards).first,
    script:
        "../scripts/evaluate_reconstruction.py"


rule evaluation_figures:
    """Error-coloured renders from front and side, and curves over time (Lips16 fig. 14 to 16)."""
    input:
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
        code=code_of("evaluation_figures"),
    script:
        "../scripts/evaluation_figures.py"


rule measures:
    """Joins the measures of all takes, and the takes together: measures.tsv, table1.tsv."""
    input:
        takes=of_takes(EVALUATED + "/sums.npz", evaluated_takes()),
        seconds=of_takes(EVALUATED + "/seconds.tsv", evaluated_takes()),
        reconstructions=of_takes(RECONSTRUCTED + "/sums.npz", reconstructed_takes()),
        tables=of_takes(EVALUATED + "/measures.tsv", evaluated_takes())
        + of_takes(RECONSTRUCTED + "/measures.tsv", reconstructed_takes()),
    output:
        measures=report(
            R + "/evaluation/measures.tsv",
            category="Tables",
            labels={"table": "all measures"},
            caption="../report/measures.rst",
        ),
        kinds=report(
            R + "/evaluation/kinds.tsv",
            category="Tables",
            labels={"table": "kinds of mouth shapes"},
            caption="../report/kinds.rst",
        ),
        table1=report(
            R + "/evaluation/table1.tsv",
            category="Tables",
            labels={"table": "table 1"},
            caption="../report/table1.rst",
        ),
        picture=report(
            R + "/evaluation/table1.png",
            category="Tables",
            labels={"table": "table 1, picture"},
            caption="../report/table1.rst",
        ),
    log:
        R + "/logs/measures.log",
    benchmark:
        R + "/benchmarks/measures.tsv"
    resources:
        mem_mb=1500,
        runtime=20,
    params:
        cfg=cfg_of("evaluation.measures"),
        code=code_of("measures"),
        takes=[{"take": take.name, "role": take.role} for take in evaluated_takes()],
    script:
        "../scripts/measures.py"
