"""Inpainted frames against images of the same frames that never had a tattoo.

    python benchmarks/bench_inpaint_pair.py FOLDER ICT_ARCHIVE NETWORKS PERFORMANCE_CSV [FIRST_ROW]

The studio renders one take of the `ict` model twice from the same curves: ten cameras with the tattoo
(and a `plain` take), and the frontal camera truly without it. The stages run on the tattooed images
with nothing but images to go by. NETWORKS is the folder of the landmark networks, PERFORMANCE_CSV a
Live Link Face recording, FIRST_ROW where the 30 frames begin in it (every third row: 10 a second).
FOLDER keeps everything; an interrupted run goes on where it was. About six minutes of one core,
rendering included.

Prints, and writes to FOLDER/inpaint.tsv:

- PSNR (dB) of display colours over the true vermilion that the frontal camera sees, a frame and over
  all: ours with each shading; `Telea` (cv2.inpaint with the exact mask of the tattoo's pixels);
  `cross-fade` and `clone` (the plain image's lips moved by the similarity of the true lip landmarks
  and blended in, or cv2.seamlessClone); `noise`, two bare images with different sensor noise;
- mm between the tracker's mouth on inpainted and on truly bare frames, same identity, weighted by area,
  after a rigid alignment of each frame on the rest of the face; the same between bare frames of different
  sensor noise.

Images for the eye: FOLDER/images/<frame>.png, columns tattooed, ours, truth, error (8 times), peers.
"""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import yaml

from vermilion.config.inpaint import InpaintConfig
from vermilion.config.studio import StudioConfig, StudioTake
from vermilion.evaluation.masks import regions_of_mask
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera, read_cameras, write_cameras
from vermilion.geometry.frame_alignment import align_frames, moved
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
from vermilion.studio.capture_writer import image_path, write_images
from vermilion.studio.take import StudioTakePlan, plan_take
from vermilion.studio.take_settings import take_settings

ROOT = Path(__file__).resolve().parents[1]
N_FRAMES, FPS, CSV_STEP = 30, 10, 3
FRONTAL = "face2"
SUBJECT_SEED = 41
LIPS = slice(48, 66)
VARIANTS = ("ratio", "difference", "none")
PEERS = ("Telea", "cross-fade", "clone")
#: Take sheets before and after the bare images exist; `bare2` has another sensor noise.
SHEET = "subject\ttake\trole\tsource\tfirst\tlast\tfps\tsplit\n"
CAPTURED = f"p1\tplain\tplain\tstudio\t0\t0\t{FPS}\tnone\np1\trom\ttattoo\tstudio\t0\t{{last}}\t{FPS}\tnone\n"
BARE = "p1\t{take}\tvideo\t{source}\t0\t{last}\t{fps}\tnone\n"


def performance(csv: str, first_row: int) -> StudioTake:
    return StudioTake(
        performance="live_link", csv=csv, csv_first=first_row, csv_fps=FPS * CSV_STEP, seed=1
    )


def write_configuration(folder: Path, archive: str, networks: str, take: StudioTake) -> None:
    """The configuration of both runs, all paths absolute."""
    content = {
        "results": "results",
        "takes": "takes.tsv",
        "chunk_frames": N_FRAMES,
        "face_model": {"name": "ict", "path": archive},
        "landmarks": {"detector": "onnx", "models": networks},
        "studio": {
            "subjects": {
                "p1": {"seed": SUBJECT_SEED, "takes": {"rom": take.model_dump(mode="json")}}
            }
        },
        "apply": {"takes": []},
    }
    _write_changed(folder / "config.yaml", yaml.safe_dump(content))


def write_sheet(folder: Path, bare: tuple[str, ...] = ()) -> None:
    rows = SHEET + CAPTURED.format(last=N_FRAMES - 1)
    for take in bare:
        rows += BARE.format(take=take, source=folder / take, last=N_FRAMES - 1, fps=FPS)
    _write_changed(folder / "takes.tsv", rows)


def _write_changed(path: Path, text: str) -> None:
    if not path.is_file() or path.read_text() != text:
        path.write_text(text)


def run_workflow(folder: Path, targets: list[str]) -> None:
    command = [sys.executable, "-m", "snakemake", "--snakefile", str(ROOT / "Snakefile")]
    command += ["--directory", str(folder), "--configfile", str(folder / "config.yaml")]
    command += ["--workflow-profile", str(ROOT / "profiles/default"), "--cores", "1"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src"), "OMP_NUM_THREADS": "1"}
    subprocess.run([*command, "--quiet", "all", "--", *targets], check=True, env=environment)


def bare_plan(model: FaceModel, take: StudioTake) -> StudioTakePlan:
    """The plan of the tattooed take, without the tattoo."""
    studio = StudioConfig()
    keys = (
        "identity_spread", "seed", "slight_open", "ease_in_frames", "intensity",
        "head_turn_deg", "head_shift_mm",
    )  # fmt: skip
    values = {
        "role": "plain",
        "first": 0,
        "last": N_FRAMES - 1,
        "fps": FPS,
        "actor": {"seed": SUBJECT_SEED, "identity": None},
        "performance": take.model_dump(mode="json"),
        **{key: getattr(studio, key) for key in keys},
    }
    return plan_take(model, take_settings(values))


def render_bare(
    folder: Path, plan: StudioTakePlan, cameras: dict[str, Camera], take: str, sensor_seed: int
) -> None:
    """The frontal camera's images without the tattoo, as a capture folder of one camera."""
    studio = StudioConfig()
    frontal = {FRONTAL: cameras[FRONTAL]}
    write_cameras(folder / take / "cameras", frontal)
    missing = [f for f in range(N_FRAMES) if not image_path(folder / take, FRONTAL, f).exists()]
    if missing:
        write_images(
            plan, frontal, folder / take, missing, 0, name="p1/rom", seed=sensor_seed,
            noise_read=studio.noise_read, noise_shot=studio.noise_shot,
            n_directions=studio.occlusion_directions, n_points=studio.light_samples,
            edge_samples=studio.edge_samples,
        )  # fmt: skip


class Scene:
    """What the frames are measured with: truth, masks, the inpainter's inputs."""

    def __init__(self, folder: Path, plan: StudioTakePlan):
        self.folder, self.results, self.plan = folder, folder / "results", plan
        self.capture = self.results / "captures/p1/rom"
        take = self.results / "takes/p1/rom"
        self.chunk = f"000000-{N_FRAMES - 1:06d}"
        self.camera = read_cameras(take / "cameras")[FRONTAL]
        self.template = FaceModel.load(self.results / "face_model/template.npz")
        self.meshes = read_sequence(take / f"multiview/H/{self.chunk}.npy")
        self.inpainted = take / "inpaint" / self.chunk
        self.paint = self._paint(take)
        regions = plan.model.regions
        self.red = regions["vermilion_upper"] | regions["vermilion_lower"]
        self.plain = read_image(image_path(self.results / "captures/p1/plain", FRONTAL, 0))

    def _paint(self, take: Path) -> InpaintInputs:
        config = InpaintConfig()
        cfg, how = config.domain, config.composite
        domain = lip_domain(self.template, cfg.skin_mm, cfg.inner_mm, cfg.texel_mm)
        plain, _ = read_texture(self.results / "subjects/p1/plain_texture.exr", domain)
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
        """The stage's own image, or the same painted here with another shading."""
        if mode == self.paint.shading.mode:
            return to_display(read_image(self.inpainted / f"{frame:06d}.png"))
        paint = replace(self.paint, shading=replace(self.paint.shading, mode=mode))
        mesh = np.asarray(self.meshes[frame], dtype=np.float64)
        seed = noise_seed(0, "p1", "rom", frame)
        return to_display(
            inpaint_frame(paint, inked, self.camera, mesh, self.template.triangles, seed).linear
        )

    def lips_px(self, frame: int) -> np.ndarray:
        """The true lip landmarks in the frontal image."""
        return self.camera.project(self.plan.vertices_mm(frame)[self.plan.model.landmarks[LIPS]])


def tattooed_pixels(inked: np.ndarray, bare: np.ndarray) -> np.ndarray:
    """(h, w) uint8, 255 where the tattoo changed the display colour, one pixel wider."""
    changed = np.abs(inked.astype(int) - bare).max(axis=2) > 8
    return cv2.dilate(changed.astype(np.uint8), np.ones((3, 3))) * 255


def peers(scene: Scene, frame: int, inked: np.ndarray, mask: np.ndarray) -> dict[str, np.ndarray]:
    """What needs no geometry, all given the exact mask."""
    # The plain take is the same person's neutral in the same rig, so its lips are known as well.
    similarity, _ = cv2.estimateAffinePartial2D(
        scene.lips_px(0).astype(np.float32), scene.lips_px(frame).astype(np.float32),
        method=cv2.LMEDS,
    )  # fmt: skip
    size = inked.shape[1::-1]
    moved = cv2.warpAffine(to_display(scene.plain), similarity, size, flags=cv2.INTER_CUBIC)
    alpha = cv2.GaussianBlur(mask.astype(np.float32) / 255, (0, 0), 1.0)[..., None]
    faded = np.rint(moved * alpha + inked * (1 - alpha)).astype(np.uint8)
    wide = cv2.dilate(mask, np.ones((5, 5)))
    x, y, w, h = cv2.boundingRect(wide)
    clone = cv2.seamlessClone(moved, inked, wide, (x + w // 2, y + h // 2), cv2.NORMAL_CLONE)
    return {
        "Telea": cv2.inpaint(inked, mask, 4, cv2.INPAINT_TELEA),
        "cross-fade": faded,
        "clone": clone,
    }


def squared_error(a: np.ndarray, b: np.ndarray, where: np.ndarray) -> np.ndarray:
    return ((a[where].astype(float) - b[where]) / 255) ** 2


def decibels(mean_square: float) -> float:
    return float(-10 * np.log10(max(mean_square, 1e-12)))


def measure_images(scene: Scene) -> pd.DataFrame:
    """PSNR in dB: a row a frame and a last one over all frames' pixels together."""
    rows, sums = [], {}
    for frame in range(N_FRAMES):
        linear = read_image(image_path(scene.capture, FRONTAL, frame))
        inked = to_display(linear)
        bare, again = (
            to_display(read_image(image_path(scene.folder / take, FRONTAL, frame)))
            for take in ("bare", "bare2")
        )
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
        write_sheet_of(scene, frame, inked, bare, candidates, where)
    total = {name: decibels(np.concatenate(parts).mean()) for name, parts in sums.items()}
    rows.append({"frame": "all", "pixels": sum(row["pixels"] for row in rows)} | total)
    return pd.DataFrame(rows)


def write_sheet_of(scene, frame, inked, bare, candidates, where) -> None:
    """The lips' images side by side, four times enlarged."""
    rows, columns = np.nonzero(cv2.dilate(where.astype(np.uint8), np.ones((25, 25))))
    crop = (slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1))
    default = candidates[scene.paint.shading.mode]
    error = np.clip(128 + 8 * (default.astype(int) - bare), 0, 255).astype(np.uint8)
    tiles = {"tattooed": inked, "ours": default, "truth": bare, "error x8": error}
    tiles |= {name: candidates[name] for name in (*VARIANTS[1:], *PEERS)}
    big = [
        label(cv2.resize(t[crop], None, fx=4, fy=4, interpolation=cv2.INTER_NEAREST), name)
        for name, t in tiles.items()
    ]
    big += [np.zeros_like(big[0])] * (-len(big) % 4)
    lines = [np.hstack(big[i : i + 4]) for i in range(0, len(big), 4)]
    path = scene.folder / "images" / f"{frame:03d}.png"
    path.parent.mkdir(exist_ok=True)
    cv2.imwrite(str(path), np.vstack(lines)[..., ::-1])


def measure_tracks(scene: Scene) -> None:
    """Distance between the meshes C of takes with the same motion and identity."""
    model = FaceModel.load(scene.results / "face/tracker.npz")
    meshes = {
        take: np.asarray(
            read_sequence(scene.results / f"takes/p1/{take}/tracking/C/{scene.chunk}.npy")
        )
        for take in ("rom", "bare", "bare2")
    }
    bound = np.load(scene.results / "subjects/p1/correspondence.npz")
    regions = regions_of_mask(model, bound["coarse_neutral_mm"], bound["mask"])
    print("\nmm between C on truly bare frames and on\tmouth mask\tits worst frame\tvermilion")
    for name, take in (("inpainted", "rom"), ("bare, other noise", "bare2")):
        aligned = moved(meshes[take], *align_frames(meshes[take], meshes["bare"], regions.rest))
        apart = np.linalg.norm(aligned - meshes["bare"], axis=2)
        mouth, lips = (
            apart @ (w / w.sum()) for w in map(regions.weights.get, ("mouth", "vermilion"))
        )
        print(f"{name}\t{mouth.mean():.3f}\t{mouth.max():.3f}\t{lips.mean():.3f}")


def main() -> None:
    folder, archive, networks, csv = (Path(p).resolve() for p in sys.argv[1:5])
    first_row = int(sys.argv[5]) if len(sys.argv) > 5 else 2258
    cv2.setNumThreads(1)
    folder.mkdir(parents=True, exist_ok=True)
    take = performance(str(csv), first_row)
    write_configuration(folder, str(archive), str(networks), take)
    results, chunk = folder / "results", f"000000-{N_FRAMES - 1:06d}"
    if not (folder / "bare2").is_dir():
        write_sheet(folder)
        run_workflow(folder, [f"results/takes/p1/rom/inpaint/{chunk}"])
    plan = bare_plan(FaceModel.load(results / "face_model/studio.npz"), take)
    cameras = read_cameras(results / "captures/p1/rom/cameras")
    for name, sensor_seed in (("bare", 0), ("bare2", 1)):
        render_bare(folder, plan, cameras, name, sensor_seed)
    write_sheet(folder, ("bare", "bare2"))
    targets = [f"results/takes/p1/{t}/tracking/C/{chunk}.npy" for t in ("rom", "bare", "bare2")]
    run_workflow(folder, [*targets, "results/subjects/p1/correspondence.npz"])
    scene = Scene(folder, plan)
    table = measure_images(scene)
    table.to_csv(folder / "inpaint.tsv", sep="\t", index=False, float_format="%.2f")
    print(table.to_string(index=False, float_format="%.1f"))
    measure_tracks(scene)


if __name__ == "__main__":
    main()
