"""Pieces of a self-contained HTML page."""

from __future__ import annotations

import base64
import html
import math
import os
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from vermilion.storage.errors import InputError

#: Smaller image files are embedded as they are.
_LARGE_BYTES = 60_000
#: Width of the text, and so of the images as they are shown.
_SHOWN_PX, _QUALITY = 1032, 82
_STYLE = """
:root { --ink: #23211f; --soft: #6d6761; --line: #e4dfd9; --accent: #a63d2f; --paper: #fffdfb; }
* { box-sizing: border-box; }
body { margin: 0; background: var(--paper); color: var(--ink);
  font: 16px/1.55 system-ui, "Segoe UI", Roboto, "Helvetica Neue", sans-serif; }
main { max-width: 1080px; margin: 0 auto; padding: 36px 24px 96px; }
h1 { font-size: 30px; margin: 0 0 4px; } h1 + p { color: var(--soft); margin: 0 0 24px; }
h2 { font-size: 21px; margin: 52px 0 10px; padding-top: 14px; border-top: 1px solid var(--line); }
h3 { font-size: 16px; margin: 26px 0 6px; }
p { max-width: 74ch; } a { color: var(--accent); }
nav { font-size: 14px; color: var(--soft); } nav a { margin-right: 14px; white-space: nowrap; }
table { border-collapse: collapse; font-size: 14px; margin: 10px 0 18px; }
th, td { padding: 4px 14px 4px 0; text-align: left; border-bottom: 1px solid var(--line);
  vertical-align: top; }
th { color: var(--soft); font-weight: 600; white-space: nowrap; }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; }
tr.group td { border-top: 2px solid var(--line); }
.scroll { overflow-x: auto; }
figure { margin: 14px 0 26px; } figure img, video { max-width: 100%; height: auto; display: block; }
figcaption { color: var(--soft); font-size: 14px; margin-top: 6px; max-width: 74ch; }
.figures { display: flex; flex-wrap: wrap; gap: 12px; margin: 14px 0 22px; }
.figures div { flex: 1 1 190px; border: 1px solid var(--line); border-radius: 6px; padding: 12px 16px;
  background: #fff; }
.figures b { font-size: 24px; display: block; } .figures span { color: var(--soft); font-size: 13px; }
.figures p { margin: 8px 0 0; font-size: 14px; line-height: 1.45; }
details { margin: 8px 0; } summary { cursor: pointer; color: var(--accent); }
details.part { margin: 0; border-top: 1px solid var(--line); padding: 2px 0; }
details.part > summary { padding: 9px 0; } details.part[open] { padding-bottom: 24px; }
details.part > summary h2 { display: inline; margin: 0; padding: 0; border: 0; font-size: 17px; }
button { font: inherit; font-size: 14px; padding: 4px 12px; border: 1px solid var(--line);
  border-radius: 6px; background: #fff; color: var(--accent); cursor: pointer; }
code { font: 13px/1.5 ui-monospace, Menlo, Consolas, monospace; background: #f5f1ec; padding: 1px 4px; }
.none { color: var(--soft); }
"""


#: A link to a folded part opens it; so does the button, and printing opens all.
_UNFOLD = """
const parts = [...document.querySelectorAll("details.part")];
const unfold = () => {
  const wanted = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  if (wanted) { wanted.open = true; wanted.scrollIntoView(); }
};
addEventListener("hashchange", unfold); unfold();
addEventListener("beforeprint", () => parts.forEach((part) => { part.open = true; }));
document.getElementById("unfold").onclick = () => {
  const open = !parts.every((part) => part.open);
  parts.forEach((part) => { part.open = open; });
};
"""


def page(
    title: str,
    lead: str,
    sections: Sequence[tuple[str, str]],
    parts: Sequence[tuple[str, str]] = (),
) -> str:
    """A whole page. `sections` and the folded `parts` are (heading, HTML body) pairs; empty bodies are left out."""
    kept = [(heading, body) for heading, body in sections if body]
    links = " ".join(f'<a href="#{slug(h)}">{text(h)}</a>' for h, _ in kept)
    bodies = "\n".join(f'<h2 id="{slug(h)}">{text(h)}</h2>\n{body}' for h, body in kept)
    nav = "" if parts else f"<nav>{links}</nav>\n"  # the folded parts are a list of their own
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{text(title)}</title><style>{_STYLE}</style></head><body><main>\n"
        f"<h1>{text(title)}</h1><p>{text(lead)}</p>\n{nav}{bodies}\n{_folded_parts(parts)}"
        "</main></body></html>\n"
    )


def _folded_parts(parts: Sequence[tuple[str, str]]) -> str:
    kept = [(heading, body) for heading, body in parts if body]
    if not kept:
        return ""
    folded = "\n".join(
        f'<details class="part" id="{slug(h)}"><summary><h2>{text(h)}</h2></summary>\n{body}</details>'
        for h, body in kept
    )
    button = '<p><button id="unfold">Open or close all</button></p>'
    return f'<h2 id="details">Details</h2>\n{button}\n{folded}\n<script>{_UNFOLD}</script>\n'


def text(value: object) -> str:
    """Escaped text."""
    return html.escape(str(value))


def slug(heading: str) -> str:
    return "".join(c if c.isalnum() else "-" for c in heading.lower())


def number(value: object, digits: int = 2) -> str:
    """A number as people read it; nothing for NaN."""
    if isinstance(value, float):
        if math.isnan(value):
            return ""
        if value != 0 and abs(value) < 10**-digits:
            return f"{value:.2g}"
        return f"{value:.{digits}f}"
    return text(value)


def spans(frames: Sequence[int]) -> str:
    """`3-5, 9` of frame numbers."""
    parts: list[list[int]] = []
    for frame in sorted({int(f) for f in frames}):
        if parts and frame == parts[-1][1] + 1:
            parts[-1][1] = frame
        else:
            parts.append([frame, frame])
    return ", ".join(f"{a}" if a == b else f"{a}-{b}" for a, b in parts)


def frames_of_each(rows: pd.DataFrame, columns: Sequence[str]) -> pd.DataFrame:
    """Of the rows with the same values in the columns, in order: how many frames (`count`), `which`."""
    return (
        rows.groupby(list(columns), sort=False)["frame"]
        .agg(["count", lambda numbers: spans(numbers.tolist())])
        .set_axis(["count", "which"], axis=1)
        .reset_index()
    )


def table(rows: pd.DataFrame, headings: dict[str, str], group: str | None = None) -> str:
    """Columns of a table under other headings; a line above each new value of column `group`."""
    numeric = {c for c in headings if pd.api.types.is_numeric_dtype(rows[c])}

    def cell(tag: str, column: str, content: str) -> str:
        kind = ' class="n"' if column in numeric else ""
        return f"<{tag}{kind}>{content}</{tag}>"

    lines = ["".join(cell("th", c, text(h)) for c, h in headings.items())]
    previous = None
    body = []
    for _, row in rows.iterrows():
        new = group is not None and row[group] != previous
        previous = row[group] if group is not None else None
        cells = "".join(cell("td", c, "" if row[c] is None else number(row[c])) for c in headings)
        body.append(f"<tr{' class=group' if new else ''}>{cells}</tr>")
    return (
        f'<div class="scroll"><table><thead><tr>{lines[0]}</tr></thead>'
        f"<tbody>{''.join(body)}</tbody></table></div>"
    )


def figures(items: Sequence[tuple[str, ...]]) -> str:
    """A row of large figures: (figure, what it is), and what a sentence says of it where there is one."""
    boxes = "".join(
        f"<div><b>{text(f)}</b><span>{text(w)}</span>{''.join(f'<p>{text(s)}</p>' for s in said)}</div>"
        for f, w, *said in items
    )
    return f'<div class="figures">{boxes}</div>' if items else ""


def image(path: str | Path, caption: str, folder: str | Path | None = None) -> str:
    """An image file, embedded in the size in which it is shown (large ones as WebP).

    Args:
        folder: that the page lies in: the image leads to its file.
    """
    path = Path(path)
    link = None if folder is None else Path(os.path.relpath(path, folder)).as_posix()
    content = path.read_bytes()
    if len(content) <= _LARGE_BYTES:
        return embedded(content, "png", caption, link)
    pixels = cv2.imread(str(path))
    if pixels is None:
        raise InputError(
            "a file that is no readable image", "PNG or JPEG", "Remove it and run again.", path=path
        )
    if pixels.shape[1] > _SHOWN_PX:
        height = round(pixels.shape[0] * _SHOWN_PX / pixels.shape[1])
        pixels = cv2.resize(pixels, (_SHOWN_PX, height), interpolation=cv2.INTER_AREA)
    encoded = cv2.imencode(".webp", pixels, [cv2.IMWRITE_WEBP_QUALITY, _QUALITY])[1]
    return embedded(encoded.tobytes(), "webp", caption, link)


def jpeg(pixels: np.ndarray, quality: int) -> bytes:
    """`pixels` (h, w, 3) uint8 RGB as a JPEG file of a quality of 0 to 100."""
    pixels = np.ascontiguousarray(pixels[..., ::-1])
    return cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()


def embedded(content: bytes, kind: str, caption: str, link: str | None = None) -> str:
    """The bytes of an image file (`kind` png, jpeg or webp) as a figure that leads to `link`."""
    encoded = base64.b64encode(content).decode("ascii")
    shown = f'<img alt="{text(caption)}" src="data:image/{kind};base64,{encoded}">'
    if link is not None:
        shown = f'<a href="{text(link)}" title="open the file">{shown}</a>'
    return f"<figure>{shown}<figcaption>{text(caption)}</figcaption></figure>"


def video(path: str | Path, caption: str, limit_mb: float, folder: str | Path | None = None) -> str:
    """An MP4, embedded up to `limit_mb`, else named; linked from a page in `folder`."""
    path = Path(path)
    name = f"<code>{text(path)}</code>"
    if folder is not None:
        # Named as in the results: where these lie is another place on each machine.
        there = Path(os.path.relpath(path, folder))
        within = Path(*(part for part in there.parts if part != ".."))
        name = f'<a href="{text(there.as_posix())}"><code>{text(within.as_posix())}</code></a>'
    if path.stat().st_size > limit_mb * 1e6:
        size = path.stat().st_size / 1e6
        return f"<p>{text(caption)} {name} ({size:.0f} MB, not embedded).</p>"
    encoded = base64.b64encode(path.read_bytes()).decode("ascii")
    return (
        f'<figure><video controls autoplay loop muted playsinline src="data:video/mp4;base64,{encoded}">'
        f"</video><figcaption>{text(caption)} {name}</figcaption></figure>"
    )


def folded(summary: str, body: str) -> str:
    """A part that opens on a click."""
    return f"<details><summary>{text(summary)}</summary>{body}</details>"
