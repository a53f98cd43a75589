"""The page of one corrected take: the video beside its result, the time line of warnings, the files."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from vermilion.report import page
from vermilion.report.reason_kinds import by_kind

#: Stages in the order in which they run.
_STAGES = ("run", "capture", "landmarks", "tracking", "contours", "features", "apply")


@dataclass(frozen=True)
class TakeFile:
    """A file to take away: its link from the page, its size, what it is and what opens it."""

    link: str
    size_bytes: int
    what: str


@dataclass(frozen=True)
class TakePage:
    """What the page shows.

    Attributes:
        title: name of the take.
        frames: (F,) frame numbers.
        fps: frames a second.
        face_model: the face model of the track, for people.
        correction: what corrected the lips, for people.
        video: an MP4 that browsers play, one image a frame.
        opening_mm: (F,) distance of the lips at their middle; NaN where not tracked.
        flagged: rows of the take in quality.tsv: stage, frame, valid, reason.
        files: to take away.
        configuration: file with which one goes on.
        track: folder of the track's vertices before correction, from the page.
        guide: link to the page on bad takes; empty: none.
    """

    title: str
    frames: np.ndarray
    fps: float
    face_model: str
    correction: str
    video: bytes
    opening_mm: np.ndarray
    flagged: pd.DataFrame
    files: Sequence[TakeFile]
    configuration: str
    track: str = ""
    guide: str = ""


def take_page(found: TakePage) -> str:
    """The page as one string of HTML with everything embedded."""
    count, seconds = len(found.frames), len(found.frames) / found.fps
    lead = (
        f"{count} frames, {seconds:.1f} s at {found.fps:.4g} frames a second. "
        f"Face model: {found.face_model}. Correction: {found.correction}."
    )
    return page.page(
        found.title,
        lead,
        [
            ("Video beside result", _player(found) + _timeline(found)),
            ("Warnings", _warnings(found)),
            ("Files to take away", _files(found)),
            ("Going on", _going_on(found)),
        ],
    )


def _player(found: TakePage) -> str:
    encoded = base64.b64encode(found.video).decode("ascii")
    return (
        f"{_STYLE}<figure class=shot><video id=shot loop muted playsinline "
        f'src="data:video/mp4;base64,{encoded}"></video>'
        "<figcaption>Left the video, right the result; below, the mouth from near.</figcaption></figure>"
        '<p class=bar><button id=play>Play</button><button id=back title="frame before">&lsaquo;</button>'
        '<button id=next title="next frame">&rsaquo;</button><button id=slow>Quarter speed</button> '
        "<span class='none keys'>Space plays and stops, the arrow keys go frame by frame.</span></p>"
    )


def _timeline(found: TakePage) -> str:
    """Marks of each stage over the frames, and the opening of the lips, drawn by the script."""
    position = {int(frame): index for index, frame in enumerate(found.frames)}
    rows = []
    for stage in _stages_of(found.flagged):
        of_stage = found.flagged[found.flagged["stage"] == stage]
        marks = [
            [position[int(frame)], int(valid), "" if pd.isna(reason) else str(reason)]
            for frame, valid, reason in of_stage[["frame", "valid", "reason"]].itertuples(
                index=False
            )
            if int(frame) in position
        ]
        rows.append({"name": stage, "marks": marks})
    opening = [None if not np.isfinite(v) else round(float(v), 2) for v in found.opening_mm]
    data = {
        "first": int(found.frames[0]), "count": len(found.frames), "fps": found.fps,
        "rows": rows, "opening": opening,
    }  # fmt: skip
    text = json.dumps(data).replace("<", "\\u003c")
    return (
        '<div class=timeline><canvas id=line aria-label="time line of warnings"></canvas>'
        "<p id=said class=none></p></div><p class=legend><i class=bad></i>not usable "
        "<i class=warn></i>warning <i class=curve></i>opening of the lips, mm. Click the time line to go "
        f"to a frame.</p><script>const take = {text};\n{_SCRIPT}</script>"
    )


def _stages_of(flagged: pd.DataFrame) -> list[str]:
    """Stages with a flagged frame, in the order in which they run."""
    named = list(dict.fromkeys(flagged["stage"]))
    return sorted(named, key=lambda s: _STAGES.index(s) if s in _STAGES else len(_STAGES))


def _warnings(found: TakePage) -> str:
    if found.flagged.empty:
        return '<p class="none">None: every stage could use every frame.</p>'
    names = ("stage", "", "frames", "which", "reason, and what to do")
    heads = "".join(f"<th>{name}</th>" for name in names)
    body = "".join(
        f"<tr><td>{page.text(row.stage)}</td><td>{row.state}</td>"
        f"<td class=n>{row.count}<span class=unit> frames</span></td>"
        f"<td class=which>{row.which}</td><td class=why>{page.text(row.reason)}"
        f"<span class=remedy>{page.text(row.remedy)}</span></td></tr>"
        for row in by_kind(found.flagged)
    )
    guide = f'<a href="{page.text(found.guide)}">Mend a bad take</a>' if found.guide else ""
    more = f"<p>{guide} explains each kind of reason.</p>" if guide else ""
    return (
        f"<p>{frames_with_warnings(found.flagged, len(found.frames))} Stages are named as in "
        f"quality.tsv.</p><div class=scroll><table class=kinds><thead><tr>{heads}</tr></thead>"
        f"<tbody>{body}</tbody></table></div>{more}"
    )


def frames_with_warnings(flagged: pd.DataFrame, count: int) -> str:
    """`55 of 102 frames have warnings.` of the rows in quality.tsv of a take with `count` frames."""
    lost = set(flagged.loc[flagged["valid"] == 0, "frame"])
    warned = set(flagged["frame"]) - lost
    verb = "has a warning" if len(warned) == 1 else "have warnings"
    said = f"{len(warned)} of {count} frames {verb}"
    if lost:
        said += f", {len(lost)} {'is' if len(lost) == 1 else 'are'} not usable"
    return f"{said}."


def _files(found: TakePage) -> str:
    lines = "".join(
        f'<tr><td><a href="{page.text(f.link)}">{page.text(f.link.rpartition("/")[2])}</a></td>'
        f"<td>{page.text(f.what)}</td><td class=n>{_size(f.size_bytes)}</td></tr>"
        for f in found.files
    )
    track = (
        "<p>The track before correction is the middle panel of overlay.mp4. Its vertices are in "
        f"<code>{page.text(found.track)}</code> (NumPy, a file for each chunk of frames, and topology.ply); "
        "docs/start/video.md writes them as OBJ files.</p>"
        if found.track
        else ""
    )
    return (
        f'<div class="scroll"><table class=files><tbody>{lines}</tbody></table></div>{track}'
        "<p class=none>Beside these files lie timeline.png (the warnings as an image) and what the next run "
        "goes on from: chunks/ and quality/.</p>"
    )


def _size(size_bytes: int) -> str:
    return f"{size_bytes / 1e6:.1f} MB" if size_bytes >= 1e5 else f"{size_bytes / 1e3:.1f} kB"


def _going_on(found: TakePage) -> str:
    return (
        "<p>The configuration of this run is <code>"
        f"{page.text(found.configuration)}</code>. Change a key in it and run "
        f"<code>make run CONFIG={page.text(found.configuration)}</code>: only what depends on the change "
        "runs again. All keys are in docs/configuration.md.</p>"
    )


_STYLE = """<style>
figure.shot { margin: 12px 0; } figure.shot video { width: 100%; max-height: 78vh; background: #161412;
  border-radius: 6px; display: block; }
.bar button { font: inherit; font-size: 14px; padding: 5px 12px; margin: 0 6px 6px 0; cursor: pointer;
  border: 1px solid var(--line); border-radius: 5px; background: #fff; color: var(--ink); }
.bar button.on { border-color: var(--accent); color: var(--accent); } .bar .none { font-size: 13px; }
.timeline { position: relative; } #line { width: 100%; display: block; cursor: crosshair;
  touch-action: pan-y; } #said { min-height: 1.5em; margin: 4px 0; font-size: 14px; }
.legend { font-size: 13px; color: var(--soft); } .legend i { display: inline-block; width: 10px;
  height: 10px; margin: 0 5px 0 12px; border-radius: 2px; } .legend i:first-child { margin-left: 0; }
.bad { background: #b3362a; } .warn { background: #e0a63a; } .curve { background: #2a6f97; }
.remedy { display: block; color: var(--soft); } .remedy:empty { display: none; } .unit { display: none; }
.kinds .which { min-width: 9em; } .files td:first-child, .files .n { white-space: nowrap; }
@media (pointer: coarse) { .keys { display: none; } }
@media (max-width: 600px) { main { padding: 20px 14px 60px; } h1 { font-size: 24px; overflow-wrap: anywhere; }
  .keys, .kinds thead { display: none; } .kinds, .kinds tbody, .files, .files tbody { display: block; }
  .kinds tr, .files tr { display: block; padding: 8px 0; border-bottom: 1px solid var(--line); }
  .kinds td, .files td { display: inline-block; border: 0; padding: 0 10px 0 0; text-align: left; }
  .kinds td.which, .kinds td.why, .files td:nth-child(2) { display: block; } .unit { display: inline; } }
</style>"""

_SCRIPT = """
const video = document.getElementById('shot'), canvas = document.getElementById('line');
const said = document.getElementById('said'), left = 108, row = 20, curve = 56;
const at = () => Math.min(take.count - 1, Math.max(0, Math.floor(video.currentTime * take.fps + 0.01)));
function draw() {
  const wide = canvas.clientWidth, high = take.rows.length * row + curve + 22, ratio = devicePixelRatio || 1;
  canvas.width = wide * ratio; canvas.height = high * ratio; canvas.style.height = high + 'px';
  const pen = canvas.getContext('2d'); pen.scale(ratio, ratio); pen.font = '12px system-ui, sans-serif';
  const span = wide - left - 8, x = n => left + span * n / take.count, each = Math.max(span / take.count, 1.5);
  take.rows.forEach((stage, index) => {
    const y = index * row;
    pen.fillStyle = '#6d6761'; pen.fillText(stage.name, 0, y + 14);
    pen.fillStyle = '#f1ece6'; pen.fillRect(left, y + 4, span, row - 8);
    for (const [n, valid] of stage.marks) {
      pen.fillStyle = valid ? '#e0a63a' : '#b3362a'; pen.fillRect(x(n), y + 3, each, row - 6);
    }
  });
  const top = take.rows.length * row + 6, most = Math.max(4, ...take.opening.filter(v => v !== null));
  pen.fillStyle = '#6d6761'; pen.fillText('opening', 0, top + 12);
  pen.textAlign = 'right'; pen.fillText(most.toFixed(0) + ' mm', left - 6, top + 12);
  pen.fillText('0', left - 6, top + curve); pen.textAlign = 'left';
  pen.strokeStyle = '#2a6f97'; pen.lineWidth = 1.4; pen.beginPath();
  let pause = true;
  take.opening.forEach((value, n) => {
    if (value === null) { pause = true; return; }
    const y = top + curve - 2 - (curve - 8) * value / most;
    pause ? pen.moveTo(x(n + 0.5), y) : pen.lineTo(x(n + 0.5), y); pause = false;
  });
  pen.stroke();
  const now = at(), reasons = [];
  pen.strokeStyle = '#23211f'; pen.lineWidth = 1; pen.beginPath();
  pen.moveTo(x(now + 0.5), 0); pen.lineTo(x(now + 0.5), high - 14); pen.stroke();
  for (const stage of take.rows) for (const [n, , why] of stage.marks) {
    if (n === now) reasons.push(stage.name + ': ' + why);
  }
  said.textContent = 'frame ' + (take.first + now) + (reasons.length ? ': ' + reasons.join('; ') : '');
}
function go(n) { video.currentTime = (Math.min(take.count - 1, Math.max(0, n)) + 0.5) / take.fps; }
canvas.addEventListener('pointerdown', event => {
  const span = canvas.clientWidth - left - 8;
  if (event.offsetX >= left) go(Math.floor((event.offsetX - left) / span * take.count));
});
document.addEventListener('keydown', event => {
  if (event.target.matches('input, textarea, select')) return;
  if (event.key === 'ArrowRight' || event.key === 'ArrowLeft') {
    step(event.key === 'ArrowRight' ? 1 : -1); event.preventDefault();
  } else if (event.key === ' ' && !event.target.matches('button, a, summary')) {
    toggle(); event.preventDefault();
  }
});
const play = document.getElementById('play'), slow = document.getElementById('slow');
function toggle() { video.paused ? video.play() : video.pause(); }
function step(by) { video.pause(); go(at() + by); }
video.addEventListener('click', toggle); play.addEventListener('click', toggle);
document.getElementById('back').addEventListener('click', () => step(-1));
document.getElementById('next').addEventListener('click', () => step(1));
slow.addEventListener('click', () => {
  video.playbackRate = video.playbackRate === 1 ? 0.25 : 1;
  slow.classList.toggle('on', video.playbackRate !== 1);
});
for (const name of ['play', 'pause']) video.addEventListener(name, () => {
  play.textContent = video.paused ? 'Play' : 'Stop';
});
function follow() { draw(); if (!video.paused) requestAnimationFrame(follow); }
for (const name of ['play', 'seeked', 'loadeddata', 'pause']) video.addEventListener(name, follow);
addEventListener('resize', draw); draw();
"""
