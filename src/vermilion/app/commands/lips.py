"""Better lips for one video: files that Blender, Maya and Unreal open, and a page to look at.

    vermilion lips clip.mp4
    vermilion lips clip.mp4 --model results/sample/models/MS.h5 --scan anna.obj --out results/lips/anna
    vermilion lips clip.mp4 --model generic             that of models/, trained on synthetic people
    vermilion lips clip.mp4 -n                          what would run

No sheet and no configuration is needed: both are written into the results, so that one can change a key and
go on with `vermilion run`. Without a model the lips of the track follow the contours in the image; with one,
they are corrected by it before. It ends with the name of `lips.html`.
"""

from __future__ import annotations

import argparse

PASSES_ON = True


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The video, what is known of it, where to write."""
    parser.add_argument(
        "video", help="a video file, a single image, or a folder of numbered images"
    )
    parser.add_argument(
        "--model", help="`generic`, or file of a trained regressor (models/<name>.h5 of a run)"
    )
    parser.add_argument("--scan", help="3D scan of the person: OBJ, PLY or STL")
    parser.add_argument("--eye-distance", help="measured distance of the person's pupils, mm")
    parser.add_argument("--out", help="folder of the results; default results/lips/<clip>")
    parser.add_argument("--first", type=int, help="first frame; default the file's")
    parser.add_argument("--last", type=int, help="last frame; default the file's")


def run(arguments: argparse.Namespace) -> int:
    """Write the configuration, run it, name the page."""
    from vermilion.app.lips import correct_lips

    return correct_lips(
        arguments.video,
        model=arguments.model,
        scan=arguments.scan,
        eye_distance=arguments.eye_distance,
        out=arguments.out,
        span=(arguments.first, arguments.last),
        options=arguments.options,
    )
