"""What the evaluation reads: takes that are measured, their truth, models.

The studio alone writes truth; besides it, only this file and evaluation.smk name it.
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


def all_evaluated_models():
    """Model files that some take is measured with."""
    people = dict.fromkeys(take.subject for take in evaluated_takes())
    return list(dict.fromkeys(path for person in people for path in evaluated_models(person)))


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
