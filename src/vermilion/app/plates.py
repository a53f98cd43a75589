"""Frontal images without tattoo and their camera, as another tracker takes them in."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from vermilion.app.run_files import read_configuration, results_paths
from vermilion.config.takes import Take
from vermilion.export.camera_files import write_camera_json, write_camera_usd
from vermilion.geometry.camera import Camera, read_cameras, write_cameras
from vermilion.imaging.display import srgb8
from vermilion.imaging.images import read_image, write_image
from vermilion.imaging.prores import write_prores
from vermilion.imaging.undistortion import straight_camera, undistorted
from vermilion.storage.errors import InputError, VermilionError
from vermilion.storage.files import atomic_folder
from vermilion.storage.progress import progress


def write_plates_of(configuration: str, wanted: str | None, form: str, out: Path | None) -> int:
    """Write the plates of a configuration's tattoo takes, or of one; returns the exit status.

    Args:
        configuration: a YAML file.
        wanted: `subject/take`; None: all.
        form: `png`, `exr` or `mov`.
        out: folder; None: `<results>/plates`.
    """
    config, takes = read_configuration(configuration)
    paths, frontal = results_paths(config), config.capture.frontal_camera
    chosen = [t for t in takes if t.role == "tattoo" and wanted in (None, t.name)]
    if not chosen:
        named = ", ".join(t.name for t in takes if t.role == "tattoo") or "none"
        raise InputError(
            f"no tattoo take {wanted or ''}".rstrip(),
            f"one of the takes with a tattoo ({named})",
            "A take of one camera without tattoo is its own plate.",
            path=configuration,
        )
    status = 0
    for take in chosen:
        folder = (out or Path(config.results) / "plates") / f"{take.subject}-{take.take}"
        try:
            images = _inpainted(paths, take)
            camera = read_cameras(Path(_filled(paths.cameras, take)))[frontal]
            _write(folder, take, images, camera, form)
        except VermilionError as error:
            print(f"{take.name}: {error}", file=sys.stderr)
            status = 1
            continue
        missing = len(take.frames) - len(images)
        left_out = f", {missing} of {len(take.frames)} frames without an image" if missing else ""
        print(f"{take.name}: {folder}{left_out}")
    return status


def _filled(pattern: str, take: Take, chunk: str = "*") -> str:
    return pattern.format(subject=take.subject, take=take.take, chunk=chunk)


def _inpainted(paths: Any, take: Take) -> dict[int, Path]:
    """Frame -> image without tattoo. Raises InputError where the stage has not run."""
    pattern = Path(_filled(paths.inpainted, take))
    found = {
        int(path.stem): path
        for path in sorted(pattern.parent.glob(f"{pattern.name}/*.png"))
        if path.parent.name.replace("-", "").isdigit() and path.stem.isdigit()
    }
    images = {frame: found[frame] for frame in map(int, take.frames) if frame in found}
    if not images:
        raise InputError(
            "no image without tattoo yet", f"{pattern}/<frame>.png",
            "Run the workflow as far as the stage `inpaint` (`make run`, or `--until inpaint`).",
        )  # fmt: skip
    return images


def _write(folder: Path, take: Take, images: dict[int, Path], camera: Camera, form: str) -> None:
    straight = straight_camera(camera, square=True)
    if form == "mov":
        plates = (srgb8(image) for _, image in _straight_images(images, camera, every=True))
        write_prores(folder / "plate.mov", plates, take.fps)
    else:
        with atomic_folder(folder / "frames" / camera.name) as temporary:
            for frame, image in _straight_images(images, camera, every=False):
                write_image(temporary / f"{frame:06d}.{form}", image)
    write_cameras(folder / "cameras", {camera.name: straight})
    write_camera_usd(folder / "camera.usda", straight, take.fps, list(images))
    write_camera_json(folder / "camera.json", straight, take.fps, list(images))


def _straight_images(
    images: dict[int, Path], camera: Camera, every: bool
) -> Iterator[tuple[int, np.ndarray]]:
    """(frame, linear (h, w, 3) without lens distortion), ascending.

    With `every`, a missing image is the one before it, so that frames of a video stay where they are.
    """
    last = None
    for frame in progress(range(min(images), max(images) + 1), "plates"):
        if frame in images:
            last = undistorted(read_image(images[frame]), camera, square=True)[0]
        elif not every:
            continue
        assert last is not None  # the first frame is there
        yield frame, last
