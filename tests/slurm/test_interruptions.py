"""What goes wrong on a cluster costs the jobs that it hits; the same command then gives the same bytes."""

import signal
import subprocess
import time

import pytest

from tests.slurm.runs import RIG_SCRIPT, RIGS, different, files_of, kill, on, wait_until

BOTH = pytest.mark.parametrize("profile", ["slurm", "slurm-generic"])


def finish(run, project, expected, cluster, seconds=600):
    """Wait for a run: it succeeds, and what it made is what it should be."""
    assert run.wait(timeout=seconds) == 0, project.printed[-4000:]
    assert different(files_of(project.results), expected) == []
    assert cluster.jobs() == []


def start_held(project, cluster, profile, *options) -> subprocess.Popen:
    """Start a run whose jobs wait: one on each node, one in the queue."""
    project.hold()
    run = project.start(*RIGS, *on(profile), *options)
    wait_until(lambda: len(project.started()) == 2, "two jobs that run")
    assert len({node for _, node, *_ in project.started()}) == 2
    return run


@pytest.mark.parametrize(
    ("first", "fault"),
    [
        ("runtime=growing(1)", "time.sleep(600)"),
        ("mem_mb=growing(800)", "much = b'x' * 1_200_000_000; time.sleep(60)"),
    ],
    ids=["time", "memory"],
)
def test_a_job_over_its_limit_is_retried_with_more(cluster, rigs, first, fault):
    project, expected = rigs
    what, least = first.split("=")
    old = {
        "runtime": "growing(30)",
        "mem_mb": "growing(1500 + len(take.frames) + 140 * sum(megapixels_of(take)))",
    }[what]
    rules = "workflow/rules/studio.smk"
    project.edit(rules, f"{what}={old}", first)
    limit = "".join(letter for letter in least if letter.isdigit())
    held = "    while Path("
    project.edit(RIG_SCRIPT, held, f"    if asked.{what} == {limit}: {fault}\n{held}")
    run = project.start(RIGS[0], *on("slurm-generic"))
    code = run.wait(timeout=300)
    assert code == 0, project.printed[-4000:]
    first_try, second_try = ([int(n) for n in row[3:]] for row in project.started())
    assert second_try == [2 * amount for amount in first_try]
    found = files_of(project.results)
    assert found.items() <= expected.items()
    assert "captures/s1/plain/cameras/cameras.txt" in found


@BOTH
def test_a_node_that_goes_down_costs_its_jobs_only(cluster, rigs, profile):
    project, expected = rigs
    run = start_held(project, cluster, profile)
    (lost,) = [row[0] for row in project.started() if row[1] == "n2"]
    cluster.crash_node("n2")
    try:
        project.release()
        finish(run, project, expected, cluster)
    finally:
        cluster.start_node("n2")
    starts = [row[0] for row in project.started()]
    assert {rule for rule in starts if starts.count(rule) > 1} == {lost}


@BOTH
def test_cancelled_jobs_are_made_again(cluster, rigs, profile):
    project, expected = rigs
    run = start_held(project, cluster, profile)
    subprocess.run(["scancel", *cluster.running()], check=True)
    project.release()
    finish(run, project, expected, cluster)


@BOTH
def test_interrupted_snakemake_cancels_its_jobs(cluster, rigs, profile):
    project, expected = rigs
    run = start_held(project, cluster, profile)
    run.send_signal(signal.SIGINT)
    assert run.wait(timeout=120) != 0
    wait_until(lambda: cluster.jobs() == [], "empty queue", 30)
    project.release()
    finish(project.start(*RIGS, *on(profile)), project, expected, cluster)


@BOTH
def test_terminated_snakemake_waits_for_its_jobs(cluster, rigs, profile):
    project, expected = rigs
    run = start_held(project, cluster, profile)
    run.send_signal(signal.SIGTERM)
    project.release()
    run.wait(timeout=300)
    assert cluster.jobs() == []
    finish(project.start(*RIGS, *on(profile)), project, expected, cluster)


@BOTH
def test_jobs_of_a_killed_snakemake_are_cancelled_by_the_next_run(cluster, rigs, profile):
    project, expected = rigs
    kill(start_held(project, cluster, profile))
    orphans = cluster.jobs()
    assert len(orphans) >= 2
    project.run(*RIGS, "--unlock")
    run = project.start(*RIGS, *on(profile))
    wait_until(lambda: not set(orphans) & set(cluster.jobs()), "end of the orphans")
    project.release()
    finish(run, project, expected, cluster)
    assert all(number in project.printed for number in orphans)


@BOTH
def test_a_controller_that_is_started_again_ends_no_run(cluster, rigs, profile):
    project, expected = rigs
    run = start_held(project, cluster, profile)
    cluster.stop_controller()
    time.sleep(20)  # several questions of Snakemake go unanswered
    assert run.poll() is None, project.printed[-4000:]
    cluster.start_controller()
    project.release()
    finish(run, project, expected, cluster)
    starts = [row[0] for row in project.started()]
    assert len(starts) == len(set(starts)) == len(RIGS)


@BOTH
def test_an_edited_configuration_changes_nothing_of_the_run_in_progress(cluster, rigs, profile):
    project, expected = rigs
    run = start_held(project, cluster, profile)
    project.edit("config/tiny.yaml", "face_size_px: [240, 300]", "face_size_px: [280, 350]")
    row = "people\tlabelled\tvideo\tstudio\t0\t"
    project.edit("config/takes.tiny.tsv", f"{row}23", f"{row}15")
    (project.folder / RIG_SCRIPT).touch()
    project.release()
    finish(run, project, expected, cluster)
    project.hold()
    planned = project.run(*RIGS, "--cores", "1", "-n")
    assert all(f"studio_rig_{rig} " in planned.stdout for rig in ("s1_plain", "s1_rom", "s2_plain"))


@BOTH
def test_jobs_refuse_code_that_was_edited_after_the_run_began(cluster, rigs, profile):
    project, expected = rigs
    run = start_held(project, cluster, profile)
    running = {row[0] for row in project.started()}
    edited = "    write_truth(plan, Path(snakemake.output.truth[0]).parent)"
    project.edit(RIG_SCRIPT, edited, f"{edited}\n    Path('edited.txt').touch()")
    project.release()
    assert run.wait(timeout=300) != 0
    made = files_of(project.results)
    assert made.items() <= expected.items()
    assert {row[0] for row in project.started()} == running
    assert not (project.folder / "edited.txt").exists()
    logs = (project.results / "logs" / "studio_rig").glob("*.log")
    assert any("changed after the run had begun" in log.read_text() for log in logs)
    finish(project.start(*RIGS, *on(profile)), project, expected, cluster)
    assert (project.folder / "edited.txt").exists()
    assert all(row in [r[0] for r in project.started()][2:] for row in running)


@BOTH
def test_jobs_refuse_rules_that_were_edited_after_the_run_began(cluster, rigs, profile):
    project, expected = rigs
    run = start_held(project, cluster, profile)
    running = {row[0] for row in project.started()}
    project.edit("workflow/rules/guided.smk", "rule guided_train:", "# Edited.\nrule guided_train:")
    project.release()
    assert run.wait(timeout=300) != 0
    assert files_of(project.results).items() <= expected.items()
    assert {row[0] for row in project.started()} == running
    finish(project.start(*RIGS, *on(profile)), project, expected, cluster)
