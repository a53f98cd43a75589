"""The linear face model in its three parts: studio, template (topology of H), tracker (of C)."""


rule face_archive:
    """Downloads the pinned ICT-FaceKit archive and checks its SHA-256."""
    output:
        P.face_archive,
    log:
        P.log("face_archive", "run"),
    benchmark:
        P.benchmark("face_archive", "run")
    localrule: True
    resources:
        mem_mb=growing(800),
        runtime=growing(60),
    params:
        cfg=cfg_of("face_model.url", "face_model.sha256"),
        code=code_of("face_model/face_archive"),
    script:
        "../scripts/face_model/face_archive.py"


def face_source(wildcards):
    """The file that the face model is read from: none for `procedural`."""
    model = CONFIG.face_model
    if model.name == "procedural":
        return []
    return [model.path] if model.path else [P.face_archive]


rule face_model:
    """Builds the studio, template and tracker models of the configured face model."""
    input:
        source=face_source,
    output:
        multiext(P.face_models, studio="studio.npz", template="template.npz", tracker="tracker.npz"),
    log:
        P.log("face_model", "run"),
    cache: True
    resources:
        mem_mb=growing(3000),
        runtime=growing(20),
    params:
        cfg=cfg_of("face_model"),
        code=code_of("face_model/face_model"),
        wc=wildcards_of,
        roles=roles_of,
    script:
        "../scripts/face_model/face_model.py"
