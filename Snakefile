"""Vermilion: rebuild a lip-shape database from captures, train lip correction, measure and apply it.

Configuration, includes, targets: nothing else. The stages are in `workflow/rules/`, in the order of
the papers. Lips16, Guided18 and Mono13 are named in docs/papers.md.
"""

if not workflow.configfiles:

    configfile: "config/config.yaml"


include: "workflow/rules/common.smk"
include: "workflow/rules/run.smk"
include: "workflow/rules/face_model.smk"
include: "workflow/rules/studio.smk"
include: "workflow/rules/capture.smk"
include: "workflow/rules/landmarks.smk"
include: "workflow/rules/multiview.smk"
include: "workflow/rules/inpaint.smk"
include: "workflow/rules/scan.smk"
include: "workflow/rules/tracking.smk"
include: "workflow/rules/external.smk"
include: "workflow/rules/detail.smk"
include: "workflow/rules/contours.smk"
include: "workflow/rules/correspondence.smk"
include: "workflow/rules/features.smk"
include: "workflow/rules/correction.smk"
include: "workflow/rules/database.smk"
include: "workflow/rules/training.smk"
include: "workflow/rules/evaluation.smk"
include: "workflow/rules/apply.smk"
include: "workflow/rules/guided.smk"
include: "workflow/rules/report.smk"
include: "workflow/rules/targets.smk"


rule all:
    """Everything: database, regressors, measures, corrected videos, the summary."""
    default_target: True
    input:
        all_outputs(),


rule captures:
    """Only the synthetic captures, with their truth."""
    input:
        studio_outputs(),


rule database_only:
    """The training database of all subjects (Lips16 section 3)."""
    input:
        P.database,


rule detail:
    """The finer sequences of `detail.takes` and `detail.relief.takes` (Mono13 sections 7, 8)."""
    input:
        detail_outputs(),


rule guided:
    """The takes of `guided.takes`: suggested frames; where some are corrected, the whole take."""
    input:
        guided_outputs(),


rule guided_evaluation:
    """Error of guided correction against the number of frames, for the takes of `guided.study`."""
    input:
        of_takes(P.guided_measures, studied_takes()),


rule regressors:
    """Every regressor of Lips16 section 6: PS, MS, GR."""
    input:
        regressor_outputs(),


rule generic:
    """A regressor of motion from many people of the studio, for people whom no training saw."""
    input:
        P.model.format(regressor=GENERIC),


onstart:
    refuse_in_a_bucket()
    refuse_impossible_jobs()
    cancel_orphaned_jobs()
    prepare_slurm()
    record_beginning()
    mend_clock()
    JOBS_STARTED.append(True)


onsuccess:
    record_checksums()


onerror:
    record_checksums()
