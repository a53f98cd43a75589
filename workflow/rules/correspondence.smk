"""Triangle-to-triangle correspondence of C and H, once a subject (Lips16 4.1)."""


def reference_take(wildcards):
    """The take whose first frame is the subject's neutral: its first with an accurate mesh."""
    found = takes("tattoo", wildcards.subject)
    if not found:
        raise WorkflowError(
            f"subject {wildcards.subject}: found no take of role `tattoo`; expected one. A "
            f"correspondence needs an accurate mesh. Add the take to {CONFIG.takes}."
        )
    return found[0]


def of_reference_take(pattern):
    """Input function: `pattern` for the first chunk of the subject's reference take."""
    return lambda wildcards: of_chunks(pattern, reference_take(wildcards))[0]


rule correspondence:
    """Lays the coarse neutral over the accurate one and binds every triangle: correspondence.npz."""
    input:
        template=P.template,
        tracker=tracker_of,
        accurate=of_reference_take(P.neutral),
        coarse=of_reference_take(P.coarse),
        fit=of_reference_take(P.fit),
        landmarks=of_reference_take(P.landmarks),
        image=of_reference_take(P.inpainted),
    output:
        correspondence=P.correspondence,
        quality=P.correspondence_quality,
        overlay=P.correspondence_overlay,
    log:
        P.log("correspondence", "subject"),
    benchmark:
        P.benchmark("correspondence", "subject")
    resources:
        mem_mb=growing(1000, for_mono=330),
        runtime=growing(20),
    params:
        cfg=cfg_of("correspondence"),
        code=code_of("correspondence/correspondence"),
        take=lambda wildcards: reference_take(wildcards).take,
    script:
        "../scripts/correspondence/correspondence.py"
