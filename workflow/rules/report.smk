"""Flagged frames of all stages (quality.tsv) and the results on one page (evaluation/summary.html)."""


def used_takes(role=None):
    """Takes that the database, the evaluation or the application needs."""
    wanted = {take.name for take in database_takes() + evaluated_takes()}
    wanted |= set(applied_takes())
    people = {name.split("/")[0] for name in wanted}
    wanted |= {take.name for take in takes("plain") if take.subject in people}
    return [take for take in takes(role) if take.name in wanted]


#: Folder of a stage's quality rows and overlays within a take -> the roles that have it.
STAGE_FOLDERS = {
    "capture": ("tattoo", "plain", "video"),
    "multiview": ("tattoo",),
    "inpaint": ("tattoo",),
    "landmarks": ("tattoo", "video"),
    "tracking": ("tattoo", "video"),
    "contours": ("tattoo", "video"),
    "correction/features": ("tattoo", "video"),
    "correction": ("tattoo",),
}


def quality_files():
    """Quality tables of every stage that ran."""
    paths = [
        path
        for folder, roles in STAGE_FOLDERS.items()
        for take in used_takes(roles)
        for path in expand_chunks(
            R + "/takes/{subject}/{take}/" + folder + "/quality/{chunk}.tsv",
            take.subject,
            take.take,
        )
    ]
    labels = R + "/takes/{subject}/{take}/contours/quality/labels.tsv"
    paths += of_takes(labels, used_takes(STAGE_FOLDERS["contours"]))
    people = subjects("tattoo")
    paths += [f"{R}/subjects/{name}/correspondence/quality/neutral.tsv" for name in people]
    paths += [f"{R}/subjects/{name}/scan/quality/scan.tsv" for name in CONFIG.tracking.scans]
    paths += of_takes(EVALUATED + "/quality.tsv", evaluated_takes())
    for take in detail_takes():
        pattern = R + "/takes/{subject}/{take}/detail/quality/{chunk}.tsv"
        paths += expand_chunks(pattern, take.subject, take.take)
    for take in shading_takes():
        paths += expand_chunks(SHADING + "/quality/{chunk}.tsv", take.subject, take.take)
    for name in applied_takes():
        paths += expand_chunks(APPLIED + "/quality/{chunk}.tsv", *name.split("/"))
    return paths


def stage_overlays():
    """[stage, what, file] of the images that the page shows: the first chunk of every take."""
    rows = [["correspondence", s, f"{R}/subjects/{s}/correspondence/overlay/neutral.png"]
            for s in subjects("tattoo")]  # fmt: skip
    rows += [["scan", s, f"{R}/subjects/{s}/scan/overlay/scan.png"] for s in CONFIG.tracking.scans]
    for folder, roles in STAGE_FOLDERS.items():
        for take in used_takes(roles):
            pattern = R + "/takes/{subject}/{take}/" + folder + "/overlay/{chunk}.png"
            path = expand_chunks(pattern, take.subject, take.take)[0]
            rows.append([folder.split("/")[-1], take.name, path])
    for take in used_takes(("tattoo", "video")) if refinement_steps() else []:
        folder = f"{R}/takes/{take.name}/tracking"
        chunk = chunks(take.subject, take.take)[0]
        rows.append(["refinement", f"{take.name}, appearance", f"{folder}/appearance.png"])
        rows.append(["refinement", take.name, f"{folder}/residuals/overlay/{chunk}.png"])
    for take in detail_takes():
        pattern = R + "/takes/{subject}/{take}/detail/overlay/{chunk}.png"
        rows.append(["detail", take.name, expand_chunks(pattern, take.subject, take.take)[0]])
    for take in shading_takes():
        pattern = SHADING + "/overlay/{chunk}.png"
        path = expand_chunks(pattern, take.subject, take.take)[0]
        rows.append(["detail", f"{take.name}, relief", path])
    for take in used_takes(("tattoo", "plain")):
        path = f"{R}/takes/{take.name}/multiview/overlay/neutral.png"
        rows.append(["multiview", f"{take.name}, neutral", path])
    return rows


def measured_against(take):
    """What the report says a take is measured against."""
    if take not in evaluated_takes():
        return ""
    return "truth" if has_truth(take) else "held-out H"


def regressor_rows():
    """What the report says each regressor was trained on and is judged by."""
    rows = []
    for name in regressor_names():
        people = trained_on(name, trained_subjects())
        training = [take for take in takes_that_train() if take.subject in people]
        judged = [
            take.name
            for take in evaluated_takes()
            if name in regressors_of(take.subject, trained_subjects())
        ]
        rows.append(
            {
                "regressor": name,
                "trained_on": ", ".join(take.name for take in training),
                "frames": sum(len(take.train_frames()) for take in training),
                "judged_on": ", ".join(judged),
            }
        )
    return rows


rule quality:
    """Joins the flagged frames of every stage: quality.tsv."""
    input:
        tables=quality_files(),
    output:
        flagged=report(
            R + "/quality.tsv",
            category="Tables",
            labels={"table": "flagged frames"},
            caption="../report/quality.rst",
        ),
    log:
        R + "/logs/quality.log",
    benchmark:
        R + "/benchmarks/quality.tsv"
    resources:
        mem_mb=1000,
        runtime=20,
    params:
        code=code_of("report/quality"),
    script:
        "../scripts/report/quality.py"


rule summary:
    """Puts tables, figures, flagged frames, overlays and the method on one page: summary.html."""
    input:
        measures=R + "/evaluation/measures.tsv",
        table1=R + "/evaluation/table1.tsv",
        kinds=R + "/evaluation/kinds.tsv",
        comparisons=R + "/evaluation/comparisons.tsv",
        table2=R + "/evaluation/table2.tsv",
        table3=R + "/evaluation/table3.tsv",
        estimators=R + "/evaluation/estimators.tsv",
        image=R + "/evaluation/table1.png",
        figure16=R + "/evaluation/figure16.png",
        quality=R + "/quality.tsv",
        maps=of_takes(EVALUATED + "/error_maps.png", evaluated_takes()),
        renders=of_takes(EVALUATED + "/renders.png", evaluated_takes()),
        stretch=of_takes(EVALUATED + "/stretch.png", evaluated_takes()),
        curves=of_takes(EVALUATED + "/curves.png", evaluated_takes()),
        reconstructions=of_takes(
            R + "/takes/{subject}/{take}/multiview/report.html", used_takes("tattoo")
        ),
        training=[f"{R}/models/{name}.cv.png" for name in regressor_names()],
        overlays=[path for _, _, path in stage_overlays()],
        videos=[f"{R}/apply/{name}/overlay.mp4" for name in applied_takes()],
        timelines=[f"{R}/apply/{name}/timeline.png" for name in applied_takes()],
    output:
        page=report(
            R + "/evaluation/summary.html",
            category="Summary",
            labels={"page": "summary"},
            caption="../report/summary.rst",
        ),
    log:
        R + "/logs/summary.log",
    benchmark:
        R + "/benchmarks/summary.tsv"
    resources:
        mem_mb=2000,
        runtime=20,
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
        names={
            "maps": [take.name for take in evaluated_takes()],
            "training": regressor_names(),
            "overlays": [[stage, what] for stage, what, _ in stage_overlays()],
            "videos": applied_takes(),
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
