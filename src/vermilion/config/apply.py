"""Configuration of the apply stage."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from vermilion.config.base import StageConfig, section
from vermilion.config.regressors import GENERIC, generic_file

HEX = r"^#[0-9a-fA-F]{6}$"
#: Value of `regressor` with which contours alone move the lips.
NO_REGRESSOR = "none"
#: Values of `export.topology` that are no file.
OUR_TOPOLOGIES = ("tracker", "full")

ExportFormat = Literal["usd", "usd_shapes", "gltf", "alembic", "obj", "ply"]


class HeadConfig(StageConfig):
    """Your own head as the mesh of the exported files (docs/interchange.md)."""

    landmarks: str | None = Field(
        None,
        description="Landmarks placed by hand: a TSV with columns landmark (0 to 65), x, y, z in the head's "
        "frame; `{subject}` stands for the take's subject. Empty: they are detected in rendered views.",
    )
    shape: Literal["own", "person"] = Field(
        "own",
        description="Whose shape the head has: its `own`, which takes the corrected motion, or that of the "
        "`person` as tracked and corrected.",
    )


class ExportConfig(StageConfig):
    """Files that other programs open (docs/interchange.md)."""

    formats: list[ExportFormat] = Field(
        ["usd"],
        description="Files beside `corrected.npy`: `usd` (`corrected.usdc`, a point cache), `usd_shapes` "
        "(`corrected_shapes.usdc`, blend shapes of UsdSkel), `gltf` (`corrected.glb`, morph targets), "
        "`alembic` (`corrected.abc`, needs the optional package `alembic3d`), `obj` and `ply` (a folder "
        "with a file a frame).",
    )
    topology: str = Field(
        "tracker",
        pattern=r"^(tracker|full|.*\.([oO][bB][jJ]|[pP][lL][yY]))$",
        description="Mesh of the files: the tracker's (`tracker`), the full face model with quads, eyes, teeth "
        "and neck (`full`, also written as `full.npy`), or the OBJ or PLY of your own head, in which `{subject}` "
        "stands for the take's subject (also written as `head.npy`).",
    )
    head: HeadConfig = section(HeadConfig, "Your own head as `topology`.")
    unit_mm: float = Field(
        1.0,
        gt=0,
        le=1e6,
        description="Length of a unit in USD, Alembic, OBJ and PLY files (mm): 10 for centimetres. glTF "
        "is in metres, `.npy` in millimetres.",
    )
    tolerance_mm: float = Field(
        0.02,
        gt=0,
        le=10,
        description="How far blend shapes may be from the corrected mesh (mm, farthest vertex of the "
        "take). Smaller values need more corrective shapes.",
    )
    live_link: bool = Field(
        False,
        description="Also write `live_link.csv`: ARKit's 52 weights that give the corrected face, as Live "
        "Link Face writes them, with timecode.",
    )
    rig: str | None = Field(
        None,
        description="Folder with the blend shapes of your rig: `neutral.obj` and a file a shape, in the "
        "vertex order of the exported mesh (mm). Its weights of the take are written as `rig.csv`, and what "
        "it cannot show as two more shapes: `rig_person.obj` (what stands still) and `rig_corrective.obj`.",
    )
    flame: bool = Field(
        False,
        description="Also write `flame.npz`: FLAME's jaw and expression that give the corrected lips, in the parameters "
        "that the base was read from (docs/interchange.md). Only where the base is a sequence of such.",
    )
    plate: bool = Field(
        False,
        description="Also write the take's images without lens distortion (`plate/<frame>.jpg`), and "
        "set them behind the head in USD files.",
    )


class OverlayConfig(StageConfig):
    """The overlay video: original, base and corrected side by side."""

    panel_height_px: int = Field(
        480, ge=160, le=2160, description="Height of each of the three panels (pixels)."
    )
    margin: float = Field(
        0.35,
        ge=0.0,
        le=2.0,
        description="Margin around the face, as a share of the face's size.",
    )
    opacity: float = Field(0.85, ge=0.0, le=1.0, description="Opacity of the mesh (0 to 1).")


class MakeUpConfig(StageConfig):
    """Virtual make-up on the corrected take, lit with the estimated lighting (Mono13 9)."""

    enabled: bool = Field(
        False, description="Write `makeup.mp4` and `makeup.png`: original, make-up, checkerboard."
    )
    lipstick: str = Field("#9e0b2c", pattern=HEX, description="Colour of the lips (sRGB).")
    lipstick_opacity: float = Field(0.8, ge=0, le=1, description="Opacity on the lips (0 to 1).")
    eye_shadow: str = Field("#3d2a6b", pattern=HEX, description="Colour of the lids (sRGB).")
    eye_shadow_opacity: float = Field(0.7, ge=0, le=1, description="Opacity on the lids (0 to 1).")
    star: str = Field("#e0a92e", pattern=HEX, description="Colour of the star drawn on the cheek.")
    star_opacity: float = Field(0.85, ge=0, le=1, description="Opacity of the star (0: none).")
    checker_mm: float = Field(
        8.0, gt=0.5, le=100, description="Side of a square of the checkerboard (mm)."
    )


class ApplyConfig(StageConfig):
    """Correction of ordinary video by a trained regressor (Lips16 section 6)."""

    takes: list[str] = Field(
        [],
        description="Takes to correct, each written `subject/take`. Empty: every take of role `video`.",
    )
    regressor: str = Field(
        "MS",
        pattern=r"^[A-Za-z0-9_.{}\-]+$",
        description="Regressor to apply: `MS`, `PS-{subject}` or `GR-{subject}`, where `{subject}` "
        "stands for the take's subject, or the full name of one. `generic`: that of `models/` of the project, "
        "which was trained on synthetic people. `none`: nothing is learnt; the lips of the track follow the "
        "contours in the image.",
    )
    model: str | None = Field(
        None,
        min_length=1,
        description="File of a regressor trained elsewhere (`models/<name>.h5` of another run), used in "
        "place of `regressor`. The face model must be that of its training.",
    )
    export: ExportConfig = section(ExportConfig, "Files that other programs open.")
    overlay: OverlayConfig = section(OverlayConfig, "The overlay video.")
    makeup: MakeUpConfig = section(MakeUpConfig, "Virtual make-up.")

    def head_of(self, subject: str) -> str | None:
        """The subject's own head as the mesh of exported files; None where that is a mesh of ours."""
        topology = self.export.topology
        return None if topology in OUR_TOPOLOGIES else topology.replace("{subject}", subject)

    @property
    def trains(self) -> bool:
        """Whether a regressor of this run's own training is applied."""
        return self.model is None and self.regressor not in (NO_REGRESSOR, GENERIC)

    def file(self, face_model: str) -> str | None:
        """A regressor's file, from the project's folder, that this run does not train; None where there is none.

        Args:
            face_model: name of the face model of the track.
        """
        generic = self.model is None and self.regressor == GENERIC
        return generic_file(face_model) if generic else self.model

    def corrected_by(self, face_model: str, subject: str) -> str:
        """What corrects the lips of a subject's take, for people.

        Args:
            face_model: name of the face model of the track.
        """
        file = self.file(face_model)
        if file is None and not self.trains:
            return "no regressor (contours of the image only)"
        if file is None:
            return f"the regressor {self.regressor.replace('{subject}', subject)}"
        name = file.rpartition("/")[2]
        if f"models/{name}" == generic_file(face_model):
            return f"generic ({name}, trained on synthetic people; GR/generic in docs/measures.md)"
        return f"the regressor {name}"
