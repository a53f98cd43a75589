"""How the figures of the report were measured, in words and in settings."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from vermilion.report import page


def how_measured(
    frames: pd.DataFrame, regressors: pd.DataFrame, settings: Sequence[tuple[str, str]]
) -> str:
    """HTML: definitions, which frames train and which are measured, regressors, configuration, seeds.

    Args:
        frames: a row a take: take, role, frames, split, train, held_out, against.
        regressors: a row a regressor: regressor, trained_on, frames, judged_on.
        settings: (key, value) pairs.
    """
    takes = page.table(
        frames,
        {"take": "take", "role": "role", "frames": "frames", "split": "split", "train": "train",
         "held_out": "held out", "against": "measured against"},
    )  # fmt: skip
    trained = page.table(
        regressors,
        {"regressor": "regressor", "trained_on": "trained on", "frames": "frames",
         "judged_on": "judged on held-out frames of"},
    )  # fmt: skip
    keys = page.table(
        pd.DataFrame(settings, columns=["what", "value"]), {"what": "setting", "value": "value"}
    )
    return _TEXT + takes + _REGRESSORS + trained + "<p><b>Settings and seeds.</b></p>" + keys


_REGRESSORS = """
<p><b>Regressors.</b> PS is trained on the person, MS on all, GR on all but the person; a person who trains
nothing is judged by GR alone. <i>PS/neutral</i>, <i>MS/neutral</i> and <i>GR/neutral</i> are the same, told how the track errs
on a neutral (D of Lips16 eq. 1): in the video itself, where a frame of it is marked (<code>correction.neutral_frames</code>), and GR also in
the person's rig take; nothing of how they move. Frames that failed in an earlier stage are in none of them.</p>
"""

_TEXT = """
<p><b>Frames.</b> Only frames that the take sheet holds out are measured; no regressor saw them, nor did
the choice of its parameters. Frames that were not tracked are left out and listed above.</p>
<p><b>Correspondence.</b> A vertex of the coarse mesh C belongs to a point of H (found once a person, on
the neutral). Where truth is known, that point goes on to the nearest point of the truth's neutral that
faces the same way and is not on the other lip, and is then followed through the truth's frames. Vertices
without such a point are not measured. Where no truth is known, the held-out H takes its place.</p>
<p><b>Alignment.</b> One rigid motion a frame, without scale, brings a track onto the truth: area-weighted
least squares over the face outside the mouth mask, each regressor by itself. H is measured without
alignment.</p>
<p><b>Regions.</b> <i>mouth</i>: the triangles of the correction layer; <i>vermilion</i>: the red of both
lips; <i>face</i>: the face. The inside of the mouth is in none of them. Every mean, deviation and
percentile is weighted by the area of the neutral.</p>
<p><b>Measures.</b> Vertex error: distance to the corresponding point. Surface error: distance to the
nearest point of the true surface. Gap: lowest point of the upper lip less highest point of the lower, in
seven columns of the middle half of the mouth, in the head frame. Jitter: mean second difference over
time, less that of the truth. Moving error: vertex error without each vertex's mean offset over the take's frames in the
head frame. Contour error: distance of contour points found in the image to the outer contour of the mesh and to
what of its lips hides the mouth there, per inter-ocular distance. Lip penetration: share of frames in which one
lip lies deeper in the other than <code>evaluation.measures.through_mm</code>. Feature error: RMS of
regressed against true layer entries.</p>
<p><b>Kinds of mouth shapes.</b> By the true expression weights where they are known, each over a threshold
(pucker or funnel, rolls, presses, jaw, smiles), else by width, gap, height of the red and protrusion of the
reference's lips against its neutral; speech is what lies between.</p>
<p><b>Intervals.</b> Percentile bootstrap over clips of consecutive frames; every regressor is measured on
the same draws, so that ratios compare like with like. With one clip there is no interval.</p>
"""
