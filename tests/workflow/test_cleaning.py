"""`clean-intermediate`: nothing is missed afterwards, every change is noticed, and what is made again is the same."""

import shutil
import subprocess
import sys

import pytest

from tests.workflow.conftest import Project
from tests.workflow.disturbed_run import Results
from vermilion.provenance import checksums
from vermilion.provenance.cleaning import LIST
from vermilion.storage.files import remove_result

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def cleaned(finished, tmp_path_factory):
    """A copy of the finished run without its intermediate results: (project, what the command printed)."""
    project = Project(tmp_path_factory.mktemp("cleaned") / "project", finished.configuration)
    shutil.copytree(finished.folder, project.folder, symlinks=True)
    return project, command(project)


def command(project, *options):
    words = [sys.executable, "-m", "vermilion.app", "clean-intermediate", project.configuration]
    done = subprocess.run(
        [*words, *options],
        cwd=project.folder,
        env=project.environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def chunks_of(project, stage):
    return sorted((project.results / "takes/s1/rom" / stage).glob("0*-0*"))


def test_it_says_how_much_it_frees_and_nothing_is_missed(finished, cleaned):
    project, printed = cleaned
    before, after = (Results(run.results).digests() for run in (finished, project))
    assert "freed" in printed.splitlines()[-1] and "takes/*/*/inpaint" in printed
    gone = {name for name in before if name not in after}
    assert any("/inpaint/0" in name for name in gone)
    assert any("/contours/0" in name for name in gone)
    assert {name for name in gone if name.endswith("/corrected.npy")} == set()
    assert {name: digest for name, digest in before.items() if name in after} == {
        name: digest for name, digest in after.items() if name != LIST
    }
    assert project.would_run() == {}
    assert checksums.find_damage(project.results) == []
    assert "freed 0.0 MB" in command(project)


def test_a_changed_image_is_noticed(finished, cleaned):
    project, _ = cleaned
    needed = []
    for run in (finished, project):
        image = run.folder / "captures" / "s1" / "rom" / "frames" / "face1" / "000010.png"
        kept = image.read_bytes()
        image.write_bytes(kept + b"changed")
        needed.append(run.would_run())
        image.write_bytes(kept)
        assert run.would_run() == {}
    without, with_cleaning = needed
    assert with_cleaning["capture"] == 1  # its chunk
    assert set(without) <= set(with_cleaning)
    assert all(with_cleaning[rule] >= count for rule, count in without.items())


def test_a_changed_key_of_a_cleaned_stage_is_noticed(cleaned):
    project, _ = cleaned
    path = project.folder / project.configuration
    kept = path.read_text()
    project.edit_configuration(lambda content: content["contours"].update(maps={"least_peak": 0.3}))
    jobs = project.would_run()
    path.write_text(kept)
    assert {"contours", "features", "evaluate"} <= set(jobs)
    assert "capture" not in jobs


def test_a_lost_result_is_made_again_from_what_was_cleaned(finished, cleaned):
    project, _ = cleaned
    expected = Results(finished.results).digests()
    lost = chunks_of(project, "features")[0]
    remove_result(lost)
    jobs = project.would_run(str(lost.relative_to(project.folder)))
    assert jobs["contours"] == 1 and jobs["features"] == 1
    project.snakemake(str(lost.relative_to(project.folder)))
    found = Results(project.results).digests()
    assert {name for name in found if name != LIST and found[name] != expected[name]} == set()
    assert lost.exists() and chunks_of(project, "contours")
    # Of a folder Snakemake compares the time, not the content: what reads the folders made again follows.
    assert not {"capture", "multiview_neutral", "multiview_clip"} & set(project.would_run())
