"""Figures that a page quotes are those of the table that it names, and it says of whom they are."""

import re
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"


def test_the_page_of_a_video_says_of_whom_its_figures_are():
    page = " ".join((DOCS / "start" / "video.md").read_text(encoding="utf-8").split())
    measures = (DOCS / "measures.md").read_text(encoding="utf-8")
    people, table = re.search(
        r"^\| (\d+ synthetic people)(.*?)\n\n", measures, re.M | re.S
    ).groups()
    of_base = dict(re.findall(r"^\| ([^|]+) \| [^|]+ \| \**([0-9.]+)\** \|", table, re.M))
    assert people in page
    assert f"{of_base['null']} of the track's lip motion error is left" in page
    held_out = next(value for name, value in of_base.items() if "at a time" in name)
    assert f"{held_out} of the error is left" in page
