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
    return lambda wildcards: expand_chunks(
        pattern, wildcards.subject, reference_take(wildcards).take
    )[0]


rule correspondence:
    """Lays the coarse neutral over the accurate one and binds every triangle: correspondence.npz."""
    input:
        template=R + "/face/template.npz",
        tracker=tracker_of,
        accurate=of_reference_take(R + "/takes/{subject}/{take}/multiview/neutral.npz"),
        coarse=of_reference_take(R + "/takes/{subject}/{take}/tracking/C/{chunk}.npy"),
        fit=of_reference_take(R + "/takes/{subject}/{take}/tracking/fit.npz"),
        landmarks=of_reference_take(R + "/takes/{subject}/{take}/landmarks/{chunk}.npz"),
        image=of_reference_take(R + "/takes/{subject}/{take}/inpaint/{chunk}"),
    output:
        correspondence=R + "/subjects/{subject}/correspondence.npz",
        quality=R + "/subjects/{subject}/correspondence/quality/neutral.tsv",
        overlay=R + "/subjects/{subject}/correspondence/overlay/neutral.png",
    log:
        R + "/logs/correspondence/{subject}.log",
    benchmark:
        R + "/benchmarks/correspondence/{subject}.tsv"
    resources:
        mem_mb=1000,
        runtime=20,
    params:
        cfg=cfg_of("correspondence"),
        code=code_of("correspondence/correspondence"),
        take=lambda wildcards: reference_take(wildcards).take,
    script:
        "../scripts/correspondence/correspondence.py"
