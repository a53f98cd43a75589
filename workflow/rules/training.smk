"""Regressors from features to correction layers: models/{regressor}.h5 (Lips16 5.2, 6)."""


def trained_subjects():
    """Subjects who have training frames."""
    return list(dict.fromkeys(take.subject for take in takes("tattoo") if take.train_frames()))


def regressor_names():
    """PS of every subject who trains, MS, and GR of every subject where others train."""
    return regressors_of_study(subjects("tattoo"), trained_subjects())


def regressor_outputs():
    """The files of all regressors of Lips16 section 6."""
    return expand(P.model, regressor=regressor_names())


rule train:
    """Trains a regressor on one subject (PS), all (MS) or all but one (GR)."""
    input:
        database=lambda wildcards: (
            P.generic_database if wildcards.regressor == GENERIC else P.database
        ),
    output:
        model=P.model,
        curve=P.validation_table,
        image=P.validation_curve,
    log:
        P.log("train", "regressor"),
    benchmark:
        P.benchmark("train", "regressor")
    resources:
        mem_mb=growing(4000),
        runtime=growing(60),
    params:
        cfg=cfg_of("training"),
        code=code_of("training/train"),
    script:
        "../scripts/training/train.py"
