"""Configuration of the face model that the studio, the template and the tracker share."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from vermilion.config.base import StageConfig

ICT_COMMIT = "da5f95a607f5e6b37755b38d3385d7f2853732e5"
#: Variable of `vermilion lips`: folder or archive of ICT-FaceKit.
ICT_VARIABLE = "VERMILION_ICT_FACEKIT"
#: Face model -> its name for people.
TITLES = {"procedural": "embedded", "ict": "ICT-FaceKit"}


class FaceModelConfig(StageConfig):
    """The face model, its files, and the resolution of its three meshes."""

    name: Literal["procedural", "ict"] = Field(
        "procedural",
        description="`procedural`: generated, needs no file. `ict`: ICT-FaceKit (MIT), from `path` "
        "or downloaded from `url`.",
    )
    path: str | None = Field(
        None,
        description="`ict` only: folder `FaceXModel/` of a clone of ICT-FaceKit, or a .tar.xz, "
        ".tar.gz or .zip archive of it. Empty: the archive is downloaded.",
    )
    url: str = Field(
        f"https://github.com/ICT-VGL/ICT-FaceKit/archive/{ICT_COMMIT}.zip",
        description="`ict` only: address of the pinned archive, used when `path` is empty.",
    )
    sha256: str | None = Field(
        None,
        pattern="^[0-9a-f]{64}$",
        description="`ict` only: SHA-256 of the archive (64 lower-case hexadecimal digits), checked "
        "before it is opened; needed for a download.",
    )
    download: bool = Field(
        False, description="`ict` only: allow the download of `url` when `path` is empty."
    )
    template_slight_open: float = Field(
        0.09,
        ge=0.0,
        le=0.3,
        description="Weight of jawOpen baked into the template's neutral, so that "
        "the lips are parted (0 to 1).",
    )
    studio_spacing_mm: float = Field(
        0.8, ge=0.4, le=3.0, description="Vertex spacing at the lips of the procedural studio (mm)."
    )
    template_spacing_mm: float = Field(
        1.0,
        ge=0.5,
        le=4.0,
        description="Vertex spacing at the lips of the procedural template (mm).",
    )
    tracker_triangles: int = Field(
        6000, ge=2000, le=20000, description="Target triangle count of the tracker's mesh."
    )
    studio_identities: int = Field(
        10, ge=0, le=100, description="Identity modes of the studio and the template."
    )
    tracker_identities: int = Field(
        10, ge=0, le=100, description="Identity modes that the tracker may fit."
    )
    tracker_expressions: Literal["all", "few"] = Field(
        "all",
        description="Expressions that the tracker may fit: `all` of the face model, or `few`: without rolls, "
        "presses, funnels, shrugs and the like, a handicapped base for comparison.",
    )
    seed: int = Field(
        0, ge=0, description="Seed of the small asymmetries of the procedural studio head."
    )

    @property
    def title(self) -> str:
        """The face model's name, for people."""
        if self.name == "ict":
            return TITLES[self.name]
        return f"{TITLES[self.name]} (for {TITLES['ict']}, see {ICT_VARIABLE} in README)"

    @model_validator(mode="after")
    def _download_needs_checksum(self) -> FaceModelConfig:
        if self.name == "ict" and not self.path:
            if not self.download:
                raise ValueError(
                    "face_model.name is 'ict' but face_model.path is empty and face_model.download is "
                    "false; give the folder or archive of ICT-FaceKit, or allow the download"
                )
            if self.sha256 is None:
                raise ValueError(
                    "face_model.download is true but face_model.sha256 is empty; give the SHA-256 of "
                    "the archive at face_model.url"
                )
        return self
