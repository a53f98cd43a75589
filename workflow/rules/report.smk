"""Flagged frames of all stages (quality.tsv) and the results on one page (evaluation/summary.html)."""


def used_takes(role=None):
    """Takes that the database, the evaluation or the application needs."""
    wanted = {take.name for take in database_takes() + evaluated_takes()}
    wanted |= {take.name for take in applied_takes() + guided_takes()}
    people = {name.split("/")[0] for name in wanted}
    wanted |= {take.name for take in takes("plain") if take.subject in people}
    return [take for take in takes(role) if take.name in wanted]


#: Stage -> its quality rows and overlays of a chunk, and the roles of the takes that have them.
STAGES = {
    "capture": (P.capture_quality, P.capture_overlay, ("tattoo", "plain", "video")),
    "multiview": (P.multiview_quality, P.multiview_overlay, ("tattoo",)),
    "inpaint": (P.inpaint_quality, P.inpaint_overlay, ("tattoo",)),
    "landmarks": (
        P.landmarks_folder + "/quality/{chunk}.tsv",
        P.landmarks_folder + "/overlay/{chunk}.png",
        TRACKED_ROLES,
    ),
    "tracking": (P.tracking_quality, P.tracking_overlay, TRACKED_ROLES),
    "contours": (P.contours_quality, P.contours_overlay, TRACKED_ROLES),
    "features": (P.features_quality, P.features_overlay, TRACKED_ROLES),
    "correction": (P.correction_quality, P.correction_overlay, ("tattoo",)),
}


def quality_files():
    """Quality tables of every stage that ran."""
    return [
        *[
            path
            for quality, _, roles in STAGES.values()
            for path in of_takes(quality, used_takes(roles))
        ],
        *of_takes(P.label_quality, used_takes(TRACKED_ROLES)),
        *expand(P.correspondence_quality, subject=subjects("tattoo")),
        *expand(P.scan_quality, subject=CONFIG.tracking.scans),
        *of_takes(P.evaluated + "/quality.tsv", evaluated_takes()),
        *of_takes(P.flow_quality, detail_takes()),
        *of_takes(P.relief_quality, relief_takes()),
        *of_takes(P.apply_quality, applied_takes()),
        *of_frames(P.refined_quality, guided_takes()),
        *of_takes(P.guided_quality, sketched_takes()),
    ]


def stage_overlays():
    """[stage, what, file] of the images that the page shows: the first chunk of every take."""
    people = subjects("tattoo")
    rows = [["correspondence", s, P.correspondence_overlay.format(subject=s)] for s in people]
    rows += [["scan", s, P.scan_overlay.format(subject=s)] for s in CONFIG.tracking.scans]
    shown = [
        (stage, "", overlay, used_takes(roles)) for stage, (_, overlay, roles) in STAGES.items()
    ]
    if image_steps():
        shown.append(("tracking", ", appearance", P.appearance_overlay, used_takes(TRACKED_ROLES)))
        shown.append(("tracking", ", residuals", P.residuals_overlay, used_takes(TRACKED_ROLES)))
    shown.append(("detail", "", P.flow_overlay, detail_takes()))
    shown.append(("detail", ", relief", P.relief_overlay, relief_takes()))
    shown.append(("multiview", ", neutral", P.neutral_overlay, used_takes(("tattoo", "plain"))))
    rows += [
        ["guided", f"{take.name}, frame {int(frame)}", fill(P.refined_overlay, take, frame=frame)]
        for take in guided_takes()
        for frame in person_corrections(take)
    ]
    rows += [
        ["guided", f"{take.name}, {name}", fill(pattern, take)]
        for take in studied_takes()
        for name, pattern in (("figure 11", P.guided_figure), ("figures 10, 12", P.guided_sheet))
    ]
    shown.append(("guided", "", P.guided_chunk_overlay, sketched_takes()))
    return rows + [
        [stage, take.name + what, of_chunks(pattern, take)[0]]
        for stage, what, pattern, rows_of_stage in shown
        for take in rows_of_stage
    ]


def measured_against(take):
    """What the report says a take is measured against."""
    if take not in evaluated_takes():
        return ""
    return "truth" if has_truth(take) else "held-out H"


def regressor_rows():
    """What the report says each regressor was trained and is measured on."""
    rows = []
    for name in regressor_names():
        people = trained_on(name, trained_subjects())
        training = [take for take in takes_that_train() if take.subject in people]
        measured = [
            take.name
            for take in evaluated_takes()
            if name in regressors_of(take.subject, trained_subjects())
        ]
        rows.append(
            {
                "regressor": name,
                "trained_on": ", ".join(take.name for take in training),
                "frames": sum(len(take.train_frames()) for take in training),
                "measured_on": ", ".join(measured),
            }
        )
    return rows


def applied_kind():
    """Kind of the regressor that corrected the report's first video (PS, MS, GR); empty where none did."""
    takes = applied_takes()
    return apply_regressor(takes[0]).partition("-")[0] if takes and CONFIG.apply.trains else ""


rule quality:
    """Joins the flagged frames of every stage: quality.tsv."""
    input:
        tables=quality_files(),
    output:
        flagged=in_report(P.quality, "Tables", "quality", table="flagged frames"),
    log:
        P.log("quality", "run"),
    benchmark:
        P.benchmark("quality", "run")
    resources:
        mem_mb=growing(1000),
        runtime=growing(20),
    params:
        code=code_of("report/quality"),
        skipped=[
            {
                "subject": take.subject,
                "take": take.take,
                "frame": take.first,
                "reason": f"the whole take was left out: {CONFIG.skip_takes[take.name]}",
            }
            for take in SKIPPED
        ],
    script:
        "../scripts/report/quality.py"


rule summary:
    """Puts tables, figures, flagged frames, overlays and the method on one page: summary.html."""
    input:
        measures=P.measures,
        table1=P.table1,
        kinds=P.kinds,
        comparisons=P.comparisons,
        headline=P.headline,
        table2=P.table2,
        table3=P.table3,
        estimators=P.estimators,
        image=P.table1_figure,
        figure16=P.figure16,
        quality=P.quality,
        maps=of_takes(P.evaluated + "/error_maps.png", evaluated_takes()),
        renders=of_takes(P.evaluated + "/renders.png", evaluated_takes()),
        stretch=of_takes(P.evaluated + "/stretch.png", evaluated_takes()),
        curves=of_takes(P.evaluated + "/curves.png", evaluated_takes()),
        reconstructions=of_takes(P.multiview_page, used_takes("tattoo")),
        training=expand(P.validation_curve, regressor=regressor_names()),
        overlays=[path for _, _, path in stage_overlays()],
        videos=of_takes(P.apply_overlay, applied_takes())
        + of_takes(P.guided_overlay, sketched_takes()),
        timelines=of_takes(P.timeline, applied_takes())
        + of_takes(P.guided_timeline, sketched_takes()),
    output:
        page=in_report(P.summary, "Summary", "summary", page="summary"),
    log:
        P.log("summary", "run"),
    benchmark:
        P.benchmark("summary", "run")
    resources:
        mem_mb=growing(2000),
        runtime=growing(20),
    params:
        cfg=cfg_of(
            "evaluation.figures.embed_video_mb",
            "evaluation.measures",
            "evaluation.reference",
            "evaluation.contour",
            "evaluation.variants",
            "evaluation.variants_of",
            "studio.seed",
            "correspondence",
            "correction.integration",
            "correction.image",
            "training",
        ),
        code=code_of("report/summary"),
        applied=applied_kind(),
        names={
            "maps": [take.name for take in evaluated_takes()],
            "training": regressor_names(),
            "overlays": [[stage, what] for stage, what, _ in stage_overlays()],
            "videos": [take.name for take in applied_takes()]
            + [f"{take.name}, guided" for take in sketched_takes()],
            "reconstructions": [take.name for take in used_takes("tattoo")],
        },
        regressors=regressor_rows(),
        frames=[
            {
                "take": take.name,
                "role": take.role,
                "frames": len(take.frames),
                "split": take.split,
                "train": len(take.train_frames()) if take.role == "tattoo" else 0,
                "held_out": len(take.test_frames()),
                "against": measured_against(take),
            }
            for take in used_takes()
        ],
    script:
        "../scripts/report/summary.py"
