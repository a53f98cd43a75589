"""What `vermilion lips` says when it has ended."""

from pathlib import Path

import pandas as pd
import pytest

from vermilion.app.face_files import ModelChoice
from vermilion.app.lips_ending import ending
from vermilion.config.takes import Take
from vermilion.storage.quality import COLUMNS

ICT = ModelChoice({"name": "ict", "path": "x"}, "ICT-FaceKit", "")


@pytest.fixture
def results(tmp_path):
    folder = tmp_path / "apply" / "face" / "clip"
    folder.mkdir(parents=True)
    for name in ("lips.html", "corrected.usdc", "albedo.png"):
        (folder / name).write_bytes(b"")
    row = ("face", "clip", "apply", 3, 1, "outside the training's span")
    pd.DataFrame([row], columns=list(COLUMNS)).to_csv(
        tmp_path / "quality.tsv", sep="\t", index=False
    )
    return tmp_path


def said(results, model, face=ICT):
    take = Take("face", "clip", "video", "clip.mp4", 0, 9, 25.0, "none")
    return "\n".join(ending(results, take, face, model))


def test_it_names_the_models_the_warnings_and_what_opens_the_files(results):
    text = said(results, None)
    assert "Face model: ICT-FaceKit\n" in text
    assert "Correction: no regressor (contours of the image only)\n" in text
    assert "1 of 10 frames has a warning.\n" in text
    assert "lips.html (open in a browser)\n" in text
    assert "corrected.usdc (File > Import > Universal Scene Description; copy albedo.png" in text


def test_it_says_which_regressor_corrected_the_lips(results):
    assert "Correction: generic (" in said(results, Path("/x/models/generic-ict.h5"))
    assert "Correction: the regressor MS.h5" in said(results, Path("/x/models/MS.h5"))
    embedded = ModelChoice({"name": "procedural"}, "embedded (not found)", "")
    assert "Face model: embedded (not found)" in said(results, None, embedded)
