"""The training database of all subjects: database/lips.h5 (Lips16 3)."""


def database_takes():
    """Takes with an accurate mesh; the sheet's split says which frames train."""
    found = takes("tattoo")
    if not found:
        raise WorkflowError(
            f"{CONFIG.takes}: found no take of role `tattoo`; expected at least one. There is "
            "nothing to learn from without an accurate mesh."
        )
    return found


def all_chunks(pattern):
    """Input function: `pattern` for every chunk of every take of the database."""
    return lambda wildcards: [
        path
        for take in database_takes()
        for path in expand_chunks(pattern, take.subject, take.take)
    ]


rule database:
    """Gathers features and layers of all subjects in one HDF5, with the split of every frame."""
    input:
        layers=all_chunks(R + "/takes/{subject}/{take}/correction/layers/{chunk}.npz"),
        features=all_chunks(R + "/takes/{subject}/{take}/correction/features/{chunk}.npz"),
        correspondence=lambda wildcards: [
            f"{R}/subjects/{subject}/correspondence.npz" for subject in subjects("tattoo")
        ],
        identity=lambda wildcards: [
            f"{R}/subjects/{subject}/identity.npz" for subject in subjects("tattoo")
        ],
        neutral_pair=lambda wildcards: list(map(neutral_pair_of, subjects("tattoo"))),
    output:
        database=R + "/database/lips.h5",
    log:
        R + "/logs/database.log",
    benchmark:
        R + "/benchmarks/database.tsv"
    resources:
        mem_mb=4000,
        runtime=60,
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
                "chunks": len(chunks(take.subject, take.take)),
            }
            for take in database_takes()
        ],
    script:
        "../scripts/database/database.py"
