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
        regressors: a row a regressor: regressor, trained_on, frames, measured_on.
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
         "measured_on": "measured on held-out frames of"},
    )  # fmt: skip
    keys = page.table(
        pd.DataFrame(settings, columns=["what", "value"]), {"what": "setting", "value": "value"}
    )
    return _TEXT + takes + _REGRESSORS + trained + "<p><b>Settings and seeds.</b></p>" + keys


_REGRESSORS = """
<p><b>Regressors.</b> PS is trained on the subject itself, MS on all subjects, GR on all but the subject. A
subject without training frames is measured with GR alone. <i>PS/neutral</i>, <i>MS/neutral</i> and
<i>GR/neutral</i> are the same regressors with one addition: they know the error of the track on one neutral
frame (D of Lips16 eq. 1). That frame is marked in the video itself (<code>correction.neutral_frames</code>);
for GR it may also come from the subject's rig take. They know nothing about how the subject moves. Frames that
failed in an earlier stage train no regressor. <i>null</i> has learnt nothing: zero layers, on the same path;
<i>null/neutral</i> knows the neutrals that are known, <i>base/neutral</i> and <i>contour/neutral</i> are these tracks with
that correction alone. <i>PS/paper</i>, <i>MS/paper</i> and <i>GR/paper</i> are Lips16 to the letter.</p>
"""

_TEXT = """
<p><b>Frames.</b> Only frames that the take sheet holds out are measured. No regressor saw them, and they
had no part in the choice of its parameters. Frames that were not tracked are left out and listed above.</p>
<p><b>Correspondence.</b> A vertex of the coarse mesh C belongs to a point of H, found once a subject on the
neutral. Where truth is known, that point is carried on to the nearest point of the true neutral that faces the
same way and is not on the other lip, and is followed through the true frames. Vertices without such a point are
not measured. Where no truth is known, the held-out H takes its place.</p>
<p><b>Alignment.</b> One rigid motion a frame, without scale, brings a track onto the truth: area-weighted
least squares over the face outside the mouth mask, for each regressor separately. H is measured without
alignment.</p>
<p><b>Regions.</b> <i>mouth</i>: the triangles of the correction layer; <i>vermilion</i>: the red of both
lips; <i>face</i>: the face. None of them contains the inside of the mouth. Every mean, deviation and
percentile is weighted by the area of the neutral.</p>
<p><b>Measures.</b> Vertex error: distance to the corresponding point. Surface error: distance to the
nearest point of the true surface. Gap: lowest point of the upper lip minus highest point of the lower lip, in
seven columns of the middle half of the mouth, in the head frame. Jitter: mean second difference over
time, minus that of the truth. Lip motion, the headline: over the vermilion, vertex
error after each vertex's mean offset over the frames of the take is removed, in the head frame. Lip shape: vertex error over
the vermilion after alignment on the mouth region alone. LVE: mean over frames of the largest squared vertex error over the
vermilion. Flipped, inner mouth, edge roughness: docs/measures.md. Contour error: distance of contour points found in the image to the outer
contour of the mesh, and to the parts of its lips that hide the mouth there, per inter-ocular distance. Lip
penetration: share of frames in which one lip lies deeper in the other than
<code>evaluation.measures.through_mm</code>. Feature error: RMS of regressed against true layer entries.</p>
<p><b>Kinds of mouth shapes.</b> Where the true expression weights are known, a kind is a weight over its
threshold (pucker or funnel, rolls, presses, jaw, smiles). Elsewhere the width, the gap, the height of the red
and the protrusion of the reference's lips are compared with its neutral. Frames of no kind are speech.</p>
<p><b>Intervals.</b> Percentile bootstrap over clips of consecutive frames. Every regressor is measured on
the same draws, so that ratios compare like with like. With one clip there is no interval.</p>
"""
