"""A subject's own face model from a 3D scan (Mono13 4, Lips16 3.2): subjects/{subject}/tracker.npz."""


def scan_of(wildcards):
    """The configuration of a subject's scan."""
    if wildcards.subject not in CONFIG.tracking.scans:
        raise WorkflowError(
            f"subject {wildcards.subject}: found no scan; expected one to make a personal face model "
            "from. Name it under tracking.scans."
        )
    return CONFIG.tracking.scans[wildcards.subject]


rule scan:
    """Lays the tracker's model over a scan and transfers all its expressions."""
    input:
        tracker=P.tracker,
        scan=lambda wildcards: scan_of(wildcards).path,
        landmarks=lambda wildcards: scan_of(wildcards).landmarks or [],
        detector=lambda wildcards: [] if scan_of(wildcards).landmarks else detector_files(wildcards),
    output:
        tracker=P.own_tracker,
        landmarks=P.scan_landmarks,
        quality=P.scan_quality,
        overlay=P.scan_overlay,
    log:
        P.log("scan", "subject"),
    benchmark:
        P.benchmark("scan", "subject")
    resources:
        mem_mb=growing(3000),
        runtime=growing(30),
    params:
        cfg=lambda wildcards: {
            "scan": scan_of(wildcards).model_dump(mode="json"),
            **detector_cfg("face_model.template_slight_open"),
        },
        code=code_of("scan/scan"),
        model=detector_path,
    script:
        "../scripts/scan/scan.py"
