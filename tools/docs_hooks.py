"""Hooks of the documentation site: pages that lie outside `docs/`, and links to files of the project.

README links work on a code host, where `docs/` is a folder; on the site the same links must lead to pages.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path

from mkdocs.structure.files import File, Files

PROJECT = Path(__file__).resolve().parents[1]
#: Page of the site -> file of the project.
PAGES = {"changelog.md": "CHANGELOG.md", "contributing.md": "CONTRIBUTING.md"}
LINK = re.compile(r"\]\(([^)#\s]+)(#[^)\s]*)?\)")


def on_files(files: Files, config) -> Files:
    """Add the pages that lie outside `docs/`."""
    for page, source in PAGES.items():
        text = (PROJECT / source).read_text(encoding="utf-8")
        files.append(File.generated(config, page, content=text))
    return files


def on_page_markdown(markdown: str, page, config, files: Files) -> str:
    """Let links to files of the project lead to their page, or stand as the file's name."""
    here = page.file.src_uri
    folder = "" if here in PAGES else posixpath.join("docs", posixpath.dirname(here))

    def target(match: re.Match) -> str:
        link, anchor = match.group(1), match.group(2) or ""
        if ":" in link:
            return match.group(0)
        path = posixpath.normpath(posixpath.join(folder, link))
        pages = {source: name for name, source in PAGES.items()}
        page_uri = pages.get(path) or (path[5:] if path.startswith("docs/") else None)
        if page_uri is None:
            return match.group(0)
        return f"]({posixpath.relpath(page_uri, posixpath.dirname(here) or '.')}{anchor})"

    return LINK.sub(target, markdown)
