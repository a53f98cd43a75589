"""Regressors from features to correction layers: models/{regressor}.h5 (Lips16 5.2, 6)."""


def trained_subjects():
    """Subjects who have training frames."""
    return list(dict.fromkeys(take.subject for take in takes("tattoo") if take.train_frames()))


def regressor_names():
    """PS of every subject who trains, MS, and GR of every subject where others train."""
    return regressors_of_study(subjects("tattoo"), trained_subjects())


def regressor_outputs():
    """The files of all regressors of Lips16 section 6."""
    return [f"{R}/models/{name}.h5" for name in regressor_names()]


rule train:
    """Trains a regressor on one subject (PS), all (MS) or all but one (GR)."""
    input:
        database=R + "/database/lips.h5",
    output:
        model=R + "/models/{regressor}.h5",
        curve=R + "/models/{regressor}.cv.tsv",
        image=R + "/models/{regressor}.cv.png",
    log:
        R + "/logs/train/{regressor}.log",
    benchmark:
        R + "/benchmarks/train/{regressor}.tsv"
    resources:
        mem_mb=4000,
        runtime=60,
    params:
        cfg=cfg_of("training"),
        code=code_of("training/train"),
    script:
        "../scripts/training/train.py"
