"""A take rendered with and without lip tattoo from the same curves, and the workflow run on both.

The subject is `p1`; `rom` is the tattooed take (ten cameras) with its `plain` take beside it, `bare` and
`bare2` are the frontal camera's images of the same frames without tattoo, with two seeds of the
sensor's noise. All lies in one folder: an interrupted run goes on where it was.
"""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from vermilion.config.studio import StudioConfig, StudioTake
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera, read_cameras, write_cameras
from vermilion.imaging.images import read_image
from vermilion.studio.capture_writer import image_path, write_images
from vermilion.studio.take import StudioTakePlan, plan_take
from vermilion.studio.take_settings import take_settings

ROOT = Path(__file__).resolve().parents[1]
FPS, CSV_STEP = 10, 3
FRONTAL = "face2"
SUBJECT_SEED = 41
#: Takes without tattoo, and the seed of their sensor noise.
BARE = {"bare": 0, "bare2": 1}
HEADER = "subject\ttake\trole\tsource\tfirst\tlast\tfps\tsplit\n"


@dataclass(frozen=True)
class RenderedPair:
    """Where everything lies and what is rendered: frames of a Live Link Face recording from
    `first_row` on, every third row."""

    folder: Path
    archive: Path
    networks: Path
    recording: Path
    first_row: int
    n_frames: int

    @property
    def results(self) -> Path:
        """Results of the workflow."""
        return self.folder / "results"

    @property
    def chunk(self) -> str:
        """The only chunk's name."""
        return f"000000-{self.n_frames - 1:06d}"

    @property
    def performance(self) -> StudioTake:
        """What the studio plays."""
        return StudioTake(
            performance="live_link",
            csv=str(self.recording),
            csv_first=self.first_row,
            csv_fps=FPS * CSV_STEP,
            seed=1,
        )

    def make(self) -> None:
        """Render both, and run the stages up to the tracks and the correspondence."""
        self.folder.mkdir(parents=True, exist_ok=True)
        self._write_configuration()
        if not (self.folder / "bare2").is_dir():
            self._write_sheet()
            self._run_workflow([f"results/takes/p1/rom/inpaint/{self.chunk}"])
        plan = self.bare_plan()
        cameras = read_cameras(self.results / "captures/p1/rom/cameras")
        for take, seed in BARE.items():
            self._render_bare(plan, cameras, take, seed)
        self._write_sheet(*BARE)
        tracks = [f"results/takes/p1/{t}/tracking/C/{self.chunk}.npy" for t in ("rom", *BARE)]
        self._run_workflow([*tracks, "results/subjects/p1/correspondence.npz"])

    def image(self, take: str, frame: int) -> np.ndarray:
        """The frontal camera's image (h, w, 3), linear, of `rom`, `plain` or a bare take."""
        captures = self.folder if take in BARE else self.results / "captures" / "p1"
        return read_image(image_path(captures / take, FRONTAL, frame))

    def bare_plan(self) -> StudioTakePlan:
        """The plan of the tattooed take, without the tattoo."""
        studio = StudioConfig()
        keys = (
            "identity_spread", "expression_spread", "seed", "slight_open", "ease_in_frames", "intensity",
            "head_turn_deg", "head_shift_mm",
        )  # fmt: skip
        values = {
            "role": "plain",
            "first": 0,
            "last": self.n_frames - 1,
            "fps": FPS,
            "actor": {"seed": SUBJECT_SEED, "identity": None},
            "performance": self.performance.model_dump(mode="json"),
            **{key: getattr(studio, key) for key in keys},
        }
        model = FaceModel.load(self.results / "face_model" / "studio.npz")
        return plan_take(model, take_settings(values))

    def _render_bare(
        self, plan: StudioTakePlan, cameras: dict[str, Camera], take: str, seed: int
    ) -> None:
        """Write a capture folder of the frontal camera alone."""
        studio, capture = StudioConfig(), self.folder / take
        frontal = {FRONTAL: cameras[FRONTAL]}
        write_cameras(capture / "cameras", frontal)
        frames = range(self.n_frames)
        missing = [f for f in frames if not image_path(capture, FRONTAL, f).exists()]
        if missing:
            write_images(
                plan, frontal, capture, missing, 0, name="p1/rom", seed=seed,
                noise_read=studio.noise_read, noise_shot=studio.noise_shot,
                occlusion_directions=studio.occlusion_directions, light_samples=studio.light_samples,
                edge_samples=studio.edge_samples,
            )  # fmt: skip

    def _write_configuration(self) -> None:
        """The configuration of both runs, all paths absolute."""
        rom = self.performance.model_dump(mode="json")
        content = {
            "results": "results",
            "takes": "takes.tsv",
            "chunk_frames": self.n_frames,
            "face_model": {"name": "ict", "path": str(self.archive)},
            "landmarks": {"detector": "onnx", "models": str(self.networks)},
            "studio": {"subjects": {"p1": {"seed": SUBJECT_SEED, "takes": {"rom": rom}}}},
            "apply": {"takes": []},
        }
        _write_changed(self.folder / "config.yaml", yaml.safe_dump(content))

    def _write_sheet(self, *bare: str) -> None:
        """The take sheet, with bare takes once they exist."""
        last = self.n_frames - 1
        rows = [("plain", "plain", "studio", 0), ("rom", "tattoo", "studio", last)]
        rows += [(take, "video", self.folder / take, last) for take in bare]
        lines = [
            f"p1\t{take}\t{role}\t{source}\t0\t{end}\t{FPS}\tnone\n"
            for take, role, source, end in rows
        ]
        _write_changed(self.folder / "takes.tsv", HEADER + "".join(lines))

    def _run_workflow(self, targets: list[str]) -> None:
        command = [sys.executable, "-m", "snakemake", "--snakefile", str(ROOT / "Snakefile")]
        command += ["--directory", str(self.folder)]
        command += ["--configfile", str(self.folder / "config.yaml")]
        command += ["--workflow-profile", str(ROOT / "profiles/default"), "--cores", "1"]
        environment = {**os.environ, "PYTHONPATH": str(ROOT / "src"), "OMP_NUM_THREADS": "1"}
        subprocess.run([*command, "--quiet", "all", "--", *targets], check=True, env=environment)


def _write_changed(path: Path, text: str) -> None:
    """Write a text where it differs, so that nothing reruns for its time stamp."""
    if not path.is_file() or path.read_text() != text:
        path.write_text(text)
