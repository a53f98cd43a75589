"""Inpainted frames against images of the same frames that never had a tattoo, and against peers.

The studio renders one take of the `ict` model twice from the same curves: ten cameras with the tattoo
(and a `plain` take), and the frontal camera truly without it. The stages run on the tattooed images
with nothing but images to go by. The frames begin at `--first-row` of a Live Link Face recording, every
third row (10 frames a second). `--folder` keeps everything; an interrupted run goes on where it was.
About six minutes of one core with 30 frames, rendering included.

Prints, and writes to inpaint.tsv in the folder:

- PSNR (dB) of display colours over the true vermilion that the frontal camera sees, a frame and over
  all: ours with each shading; `Telea` (cv2.inpaint with the exact mask of the tattoo's pixels);
  `cross-fade` and `clone` (the plain image's lips moved by the similarity of the true lip landmarks
  and blended in, or cv2.seamlessClone); `noise`, two bare images with different sensor noise;
- mm between the tracker's mouth on inpainted and on truly bare frames, same identity, weighted by area,
  after a rigid alignment of each frame on the rest of the face; the same between bare frames of different
  sensor noise.

Images for the eye: images/<frame>.png in the folder, tiles tattooed, ours, truth, error (8 times), peers.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from benchmarks.common import add_data_argument, print_table
from benchmarks.inpaint import VARIANTS, decibels, squared_error
from benchmarks.rendered_pair import BARE, FRONTAL, RenderedPair
from vermilion.config.inpaint import InpaintConfig
from vermilion.evaluation.masks import regions_of_mask
from vermilion.faces.model import FaceModel
from vermilion.geometry.alignment import align_frames
from vermilion.geometry.camera import read_cameras
from vermilion.geometry.raycast import RayCaster
from vermilion.imaging.draw import label, to_display
from vermilion.imaging.images import read_image
from vermilion.inpaint.domain import lip_domain
from vermilion.inpaint.files import read_texture
from vermilion.inpaint.frame import InpaintInputs, inpaint_frame
from vermilion.inpaint.grain import noise_seed
from vermilion.inpaint.opening import OpeningSettings
from vermilion.inpaint.shading import ShadingSettings
from vermilion.storage.sequences import read_sequence

LIPS = slice(48, 66)
PEERS = ("Telea", "cross-fade", "clone")


class Scene:
    """What the frames are measured with: truth, masks, the inpainter's inputs."""

    def __init__(self, pair: RenderedPair):
        self.pair, self.plan = pair, pair.bare_plan()
        take = pair.results / "takes/p1/rom"
        self.camera = read_cameras(take / "cameras")[FRONTAL]
        self.template = FaceModel.load(pair.results / "face_model/template.npz")
        self.meshes = read_sequence(take / f"multiview/H/{pair.chunk}.npy")
        self.inpainted = take / "inpaint" / pair.chunk
        self.paint = self._paint(take)
        regions = self.plan.model.regions
        self.red = regions["vermilion_upper"] | regions["vermilion_lower"]
        self.plain = pair.image("plain", 0)

    def _paint(self, take: Path) -> InpaintInputs:
        config = InpaintConfig()
        cfg, how = config.domain, config.composite
        domain = lip_domain(self.template, cfg.skin_mm, cfg.inner_mm, cfg.texel_mm)
        plain, _ = read_texture(self.pair.results / "subjects/p1/plain_texture.exr", domain)
        reference, more = read_texture(take / "inpaint/reference.exr", domain)
        light = config.shading.model_dump()
        gap_mm = light.pop("gap_mm")
        return InpaintInputs(
            domain, plain, reference, more["opacity"], ShadingSettings(**light), cfg.edge_mm,
            how.lens_px, how.rim_px, how.samples, how.grain, gap_mm,
            OpeningSettings(**config.opening.model_dump()),
        )  # fmt: skip

    def vermilion(self, frame: int) -> np.ndarray:
        """Pixels (h, w) bool whose middle shows true vermilion."""
        triangles = self.plan.model.triangles
        hits = RayCaster(self.plan.vertices_mm(frame), triangles).see(self.camera)
        return hits.hit & self.red[triangles].all(axis=1)[hits.triangle]

    def ours(self, frame: int, inked: np.ndarray, mode: str) -> np.ndarray:
        """The stage's own display image (h, w, 3), or the same painted here on the linear image
        `inked` (h, w, 3) with another shading."""
        if mode == self.paint.shading.mode:
            return to_display(read_image(self.inpainted / f"{frame:06d}.png"))
        paint = replace(self.paint, shading=replace(self.paint.shading, mode=mode))
        mesh = np.asarray(self.meshes[frame], dtype=np.float64)
        seed = noise_seed(0, "p1", "rom", frame)
        return to_display(
            inpaint_frame(paint, inked, self.camera, mesh, self.template.triangles, seed).linear
        )

    def lips_px(self, frame: int) -> np.ndarray:
        """The true lip landmarks (18, 2) px in the frontal image."""
        return self.camera.project(self.plan.vertices_mm(frame)[self.plan.model.landmarks[LIPS]])


def tattooed_pixels(inked: np.ndarray, bare: np.ndarray) -> np.ndarray:
    """(h, w) uint8, 255 where the tattoo changed the display colour, one pixel wider.

    `inked` (h, w, 3) and `bare` (h, w, 3) are display images.
    """
    changed = np.abs(inked.astype(int) - bare).max(axis=2) > 8
    return cv2.dilate(changed.astype(np.uint8), np.ones((3, 3))) * 255


def peers(scene: Scene, frame: int, inked: np.ndarray, mask: np.ndarray) -> dict[str, np.ndarray]:
    """What needs no geometry, display images (h, w, 3).

    All are given the display image `inked` (h, w, 3) and the exact `mask` (h, w).
    """
    # The plain take is the same person's neutral in the same rig, so its lips are known as well.
    similarity, _ = cv2.estimateAffinePartial2D(
        scene.lips_px(0).astype(np.float32), scene.lips_px(frame).astype(np.float32),
        method=cv2.LMEDS,
    )  # fmt: skip
    size = inked.shape[1::-1]
    lips = cv2.warpAffine(to_display(scene.plain), similarity, size, flags=cv2.INTER_CUBIC)
    alpha = cv2.GaussianBlur(mask.astype(np.float32) / 255, (0, 0), 1.0)[..., None]
    faded = np.rint(lips * alpha + inked * (1 - alpha)).astype(np.uint8)
    wide = cv2.dilate(mask, np.ones((5, 5)))
    x, y, w, h = cv2.boundingRect(wide)
    clone = cv2.seamlessClone(lips, inked, wide, (x + w // 2, y + h // 2), cv2.NORMAL_CLONE)
    telea = cv2.inpaint(inked, mask, 4, cv2.INPAINT_TELEA)
    return dict(zip(PEERS, (telea, faded, clone), strict=True))


def measure_images(scene: Scene) -> pd.DataFrame:
    """PSNR in dB: a row a frame and a last one over all frames' pixels together."""
    rows, sums = [], {}
    for frame in range(scene.pair.n_frames):
        linear = scene.pair.image("rom", frame)
        inked = to_display(linear)
        bare, again = (to_display(scene.pair.image(take, frame)) for take in BARE)
        where, mask = scene.vermilion(frame), tattooed_pixels(inked, bare)
        candidates = {mode: scene.ours(frame, linear, mode) for mode in VARIANTS}
        candidates |= peers(scene, frame, inked, mask)
        candidates |= {"tattooed": inked, "noise": again}
        errors = {name: squared_error(c, bare, where) for name, c in candidates.items()}
        for name, error in errors.items():
            sums.setdefault(name, []).append(error)
        rows.append(
            {"frame": f"{frame}", "pixels": int(where.sum())}
            | {name: decibels(error.mean()) for name, error in errors.items()}
        )
        write_tiles(scene, frame, {"truth": bare} | candidates, where)
    total = {name: decibels(np.concatenate(parts).mean()) for name, parts in sums.items()}
    rows.append({"frame": "all", "pixels": sum(row["pixels"] for row in rows)} | total)
    return pd.DataFrame(rows)


def write_tiles(scene: Scene, frame: int, images: dict[str, np.ndarray], where: np.ndarray) -> None:
    """The lips' images side by side, four times enlarged, round the pixels `where` (h, w)."""
    rows, columns = np.nonzero(cv2.dilate(where.astype(np.uint8), np.ones((25, 25))))
    crop = (slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1))
    ours, truth = images[scene.paint.shading.mode], images["truth"]
    error = np.clip(128 + 8 * (ours.astype(int) - truth), 0, 255).astype(np.uint8)
    tiles = {"tattooed": images["tattooed"], "ours": ours, "truth": truth, "error x8": error}
    tiles |= {name: images[name] for name in (*VARIANTS[1:], *PEERS)}
    big = [
        label(cv2.resize(t[crop], None, fx=4, fy=4, interpolation=cv2.INTER_NEAREST), name)
        for name, t in tiles.items()
    ]
    big += [np.zeros_like(big[0])] * (-len(big) % 4)
    lines = [np.hstack(big[i : i + 4]) for i in range(0, len(big), 4)]
    path = scene.pair.folder / "images" / f"{frame:03d}.png"
    path.parent.mkdir(exist_ok=True)
    cv2.imwrite(str(path), np.vstack(lines)[..., ::-1])


def measure_tracks(pair: RenderedPair) -> list[dict]:
    """Distance between the meshes C of takes with the same motion and identity."""
    model = FaceModel.load(pair.results / "face_model/tracker.npz")
    folder = pair.results / "takes/p1"
    meshes = {
        take: np.asarray(read_sequence(folder / take / f"tracking/C/{pair.chunk}.npy"))
        for take in ("rom", *BARE)
    }
    bound = np.load(pair.results / "subjects/p1/correspondence.npz")
    regions = regions_of_mask(model, bound["coarse_neutral_mm"], bound["mask"])
    rows = []
    for name, take in (("inpainted", "rom"), ("bare, other noise", "bare2")):
        aligned = align_frames(meshes[take], meshes["bare"], regions.rest).apply(meshes[take])
        apart = np.linalg.norm(aligned - meshes["bare"], axis=2)
        mouth, lips = (
            apart @ (w / w.sum()) for w in map(regions.weights.get, ("mouth", "vermilion"))
        )
        rows.append(
            {
                "mm between C on bare frames and on": name,
                "mouth mask": mouth.mean(),
                "its worst frame": mouth.max(),
                "vermilion": lips.mean(),
            }
        )
    return rows


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What is rendered, and where."""
    parser.add_argument("--folder", type=Path, required=True, help="keeps what is made")
    add_data_argument(parser)
    for name, what in (
        ("archive", "ICT-FaceKit; default: the data folder's"),
        ("networks", "landmark networks; default: the data folder's"),
        ("recording", "Live Link Face CSV; default: rom.csv of the data folder"),
    ):
        parser.add_argument(f"--{name}", type=Path, metavar="PATH", help=what)
    parser.add_argument("--first-row", type=int, default=2258, help="of the CSV (%(default)s)")
    parser.add_argument("--frames", type=int, default=30, help="how many (%(default)s)")


def run(arguments: argparse.Namespace) -> None:
    """Render, run the workflow, measure and print."""
    data = arguments.data
    paths = (
        arguments.folder,
        arguments.archive or data / "ict-facekit" / "FaceXModel.tar.xz",
        arguments.networks or data / "landmarks66",
        arguments.recording or data / "performance" / "rom.csv",
    )
    pair = RenderedPair(*(path.resolve() for path in paths), arguments.first_row, arguments.frames)
    pair.make()
    table = measure_images(Scene(pair))
    table.to_csv(pair.folder / "inpaint.tsv", sep="\t", index=False, float_format="%.2f")
    print_table(table, 1)
    print()
    print_table(measure_tracks(pair), 3)
