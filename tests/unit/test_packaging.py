"""Files by which others install, deploy and cite the project name what exists."""

import re
import tomllib
from pathlib import Path

import yaml

PROJECT = Path(__file__).parents[2]


def test_the_citation_has_the_version_of_the_package():
    citation = yaml.safe_load((PROJECT / "CITATION.cff").read_text(encoding="utf-8"))
    package = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert citation["version"] == package["version"]
    assert citation["license"] == package["license"]


def test_the_container_copies_files_that_exist():
    text = (PROJECT / "Containerfile").read_text(encoding="utf-8")
    copies = re.findall(r"^COPY (?!--from)(.+) \S+$", text, re.M)
    names = [name for line in copies for name in line.split()]
    assert "requirements.lock" in names
    for name in names:
        assert (PROJECT / name).exists(), f"Containerfile copies {name}"


def test_the_container_keeps_environments_and_results_out():
    ignored = (PROJECT / ".containerignore").read_text(encoding="utf-8").split()
    assert {".venv*", "results", ".git"} <= set(ignored)


def test_the_container_is_built_from_what_is_locked_and_runs_without_root():
    text = (PROJECT / "Containerfile").read_text(encoding="utf-8")
    steps = re.sub(r"\\\n\s*", " ", re.sub(r"^#.*\n", "", text, flags=re.M)).splitlines()
    known = {"FROM", "COPY", "WORKDIR", "RUN", "ENV", "USER", "ENTRYPOINT", "CMD"}
    assert {step.split()[0] for step in steps if step.strip()} <= known
    images = [step.split()[1] for step in steps if step.startswith("FROM")]
    assert images and all(re.search(r":\d", image) for image in images)
    installs = [step for step in steps if "pip install" in step]
    assert installs and all("--require-hashes" in step or "--no-deps" in step for step in installs)
    packages = [step for step in steps if "apt-get install" in step]
    assert all("--no-install-recommends" in step and "rm -rf" in step for step in packages)
    users = [step for step in steps if step.startswith("USER")]
    assert users and users[-1].split()[1] not in ("0", "root")


def test_every_page_of_the_site_is_in_its_navigation():
    # `make docs` is strict, too, but needs its environment.
    text = (PROJECT / "mkdocs.yml").read_text(encoding="utf-8")
    navigation = set(re.findall(r"[\w/]+\.md", text.split("\nnav:\n")[1]))
    pages = {str(path.relative_to(PROJECT / "docs")) for path in (PROJECT / "docs").rglob("*.md")}
    assert pages | {"changelog.md", "contributing.md"} == navigation


def test_the_site_asks_no_network():
    # What the theme would fetch by itself: fonts, the worker of the offline search, mermaid's drawing.
    settings = (PROJECT / "mkdocs.yml").read_text(encoding="utf-8")
    assert re.search(r"^  font: false$", settings, re.M)
    assert re.findall(r"https?://\S+", settings) == []
    script = re.findall(r"^    - (\S*iframe-worker\S*)$", settings, re.M)
    assert script, "without it the plugin `offline` names an address"
    sheets = re.findall(r"^  - (stylesheets/\S+)$", settings, re.M)
    for name in (*script, *sheets):
        assert (PROJECT / "docs" / name).is_file(), name
    notice = PROJECT / "docs/javascripts/LICENSE.iframe-worker.txt"
    assert "Martin Donath" in notice.read_text(encoding="utf-8")
    for page in (*(PROJECT / "docs").rglob("*.md"), PROJECT / "CHANGELOG.md"):
        text = page.read_text(encoding="utf-8")
        assert not re.search(r"!\[[^\]]*\]\(https?:|<img|<script|```mermaid", text), page.name
