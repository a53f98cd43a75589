"""All takes together: measures.tsv, tables 1 to 3, comparisons, kinds, figure 16 (Lips16 6)."""


rule measures:
    """Joins the measures of all takes, and the takes together: measures.tsv, table1.tsv."""
    input:
        takes=of_takes(EVALUATED + "/sums.npz", evaluated_takes()),
        seconds=of_takes(EVALUATED + "/seconds.tsv", evaluated_takes()),
        frames=of_takes(EVALUATED + "/frames.tsv", evaluated_takes()),
        reconstructions=of_takes(RECONSTRUCTED + "/sums.npz", reconstructed_takes()),
        curves=[path.replace(".h5", ".cv.tsv") for path in all_evaluated_models()],
        tables=of_takes(EVALUATED + "/measures.tsv", evaluated_takes())
        + of_takes(RECONSTRUCTED + "/measures.tsv", reconstructed_takes()),
    output:
        measures=report(
            R + "/evaluation/measures.tsv",
            category="Tables",
            labels={"table": "all measures"},
            caption="../report/measures.rst",
        ),
        kinds=report(
            R + "/evaluation/kinds.tsv",
            category="Tables",
            labels={"table": "kinds of mouth shapes"},
            caption="../report/kinds.rst",
        ),
        seconds=R + "/evaluation/seconds.tsv",
        comparisons=R + "/evaluation/comparisons.tsv",
        table2=R + "/evaluation/table2.tsv",
        table3=R + "/evaluation/table3.tsv",
        estimators=R + "/evaluation/estimators.tsv",
        table1=report(
            R + "/evaluation/table1.tsv",
            category="Tables",
            labels={"table": "table 1"},
            caption="../report/table1.rst",
        ),
        figure16=report(
            R + "/evaluation/figure16.png",
            category="Errors",
            subcategory="Over time",
            labels={"take": "RBF network against affine map"},
            caption="../report/figure16.rst",
        ),
        image=report(
            R + "/evaluation/table1.png",
            category="Tables",
            labels={"table": "table 1, image"},
            caption="../report/table1.rst",
        ),
    log:
        R + "/logs/measures.log",
    benchmark:
        R + "/benchmarks/measures.tsv"
    resources:
        mem_mb=1500,
        runtime=20,
    params:
        cfg=cfg_of("evaluation.measures", "training.regressor"),
        code=code_of("evaluation/measures"),
        takes=[{"take": take.name, "role": take.role} for take in evaluated_takes()],
    script:
        "../scripts/evaluation/measures.py"
