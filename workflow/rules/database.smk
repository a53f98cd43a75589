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
        takes=lambda wildcards: [
            {
                "subject": take.subject,
                "take": take.take,
                "fps": take.fps,
                "split": take.split,
                "train": take.train_frames(),
                "chunks": len(chunks(take)),
            }
            for take in database_takes()
        ],
    script:
        "../scripts/database/database.py"
