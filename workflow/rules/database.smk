"""The training database of all subjects: database/lips.h5 (Lips16 3)."""


def database_takes():
    """Takes with an accurate mesh; the sheet's split says which frames train."""
    found = takes("tattoo")
    if not found and CONFIG.apply.trains:
        raise WorkflowError(
            f"{CONFIG.takes}: found no take of role `tattoo`; expected at least one. There is "
            "nothing to learn from without an accurate mesh."
        )
    return found


def described(rows):
    """What a database's script is told of each of some takes."""
    return [
        {
            "subject": take.subject,
            "take": take.take,
            "fps": take.fps,
            "split": take.split,
            "train": take.train_frames(),
            "chunks": len(chunks(take)),
        }
        for take in rows
    ]


rule database:
    """Gathers features and layers of all subjects in one HDF5, with the split of every frame."""
    input:
        layers=lambda wildcards: of_takes(P.layers, database_takes()),
        features=lambda wildcards: of_takes(P.features, database_takes()),
        correspondence=expand(P.correspondence, subject=subjects("tattoo")),
        identity=expand(P.identity, subject=subjects("tattoo")),
        neutral_pair=lambda wildcards: list(map(neutral_pair_of, subjects("tattoo"))),
    output:
        database=P.database,
    log:
        P.log("database", "run"),
    benchmark:
        P.benchmark("database", "run")
    resources:
        mem_mb=growing(4000),
        runtime=growing(60),
    params:
        cfg=cfg_of("database"),
        code=code_of("database/database"),
        subjects=lambda wildcards: subjects("tattoo"),
        takes=lambda wildcards: described(database_takes()),
    script:
        "../scripts/database/database.py"


def generic_takes():
    """Videos of the studio whose truth a generic regressor learns from: those that the sheet's split trains."""
    found = [take for take in takes("video") if take.source == STUDIO and take.train_frames()]
    if not found:
        raise WorkflowError(
            f"{CONFIG.takes}: found no take of role `video`, source `studio` and split `train`; expected "
            "some. A generic regressor learns from people of the studio, whose truth is known."
        )
    return found


def generic_subjects():
    """People of these takes."""
    return list(dict.fromkeys(take.subject for take in generic_takes()))


rule generic_database:
    """Gathers features of synthetic people and layers that their truth tells: database/generic.h5."""
    input:
        studio=P.studio_model,
        tracker=P.tracker,
        identity=lambda wildcards: expand(P.identity, subject=generic_subjects()),
        truth=lambda wildcards: of_takes(P.truth + "/vertices_mm.npy", generic_takes()),
        fit=lambda wildcards: of_takes(P.fit, generic_takes()),
        coarse=lambda wildcards: of_takes(P.coarse, generic_takes()),
        features=lambda wildcards: of_takes(P.features, generic_takes()),
    output:
        database=P.generic_database,
    log:
        P.log("generic_database", "run"),
    benchmark:
        P.benchmark("generic_database", "run")
    resources:
        mem_mb=growing(4000),
        runtime=growing(60),
    params:
        cfg=cfg_of("database", "correspondence", "correction.layers"),
        code=code_of("database/generic_database"),
        subjects=lambda wildcards: generic_subjects(),
        takes=lambda wildcards: described(generic_takes()),
    script:
        "../scripts/database/generic_database.py"
