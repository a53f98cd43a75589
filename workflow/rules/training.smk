"""Regressors from features to correction layers: models/{regressor}.h5 (Lips16 5.2, 6)."""


def regressor_names():
    """PS of every subject, MS, and GR of every subject where there are two or more."""
    people = subjects("tattoo")
    names = [f"PS-{subject}" for subject in people] + ["MS"]
    return names + [f"GR-{subject}" for subject in people if len(people) > 1]


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
        picture=R + "/models/{regressor}.cv.png",
    log:
        R + "/logs/train/{regressor}.log",
    benchmark:
        R + "/benchmarks/train/{regressor}.tsv"
    resources:
        mem_mb=4000,
        runtime=60,
    params:
        cfg=cfg_of("training"),
        code=code_of("train"),
    script:
        "../scripts/train.py"
