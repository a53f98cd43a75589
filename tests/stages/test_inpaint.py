"""The inpaint stage on a tiny capture: its scripts from files to files."""

from __future__ import annotations

import sys
from collections import Counter

import numpy as np
import pytest

from tests import lip_patch
from tests.stages.run_script import run_script
from vermilion.geometry.camera import write_cameras
from vermilion.geometry.raycast import RayCaster
from vermilion.imaging.draw import to_display
from vermilion.imaging.images import read_image, write_image
from vermilion.storage.sequences import write_sequence
from vermilion.storage.tables import read_table

pytestmark = pytest.mark.slow

POSES = [(0.0, 0.0), (3.0, 0.2), (6.0, 0.1)]
CFG = {
    "capture.frontal_camera": "front",
    "inpaint.domain": {"texel_mm": 0.4, "skin_mm": 9.0, "inner_mm": 4.0},
    "inpaint.mask": {},
    "inpaint.shading": {},
    "inpaint.opening": {},
    "inpaint.composite": {"lens_px": 0.0},
}


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """A tattoo take of three frames and a plain take, with what multiview makes of them."""
    root = tmp_path_factory.mktemp("inpaint")
    model, rig = lip_patch.face_model(), lip_patch.cameras()
    model.save(root / "template.npz")
    write_cameras(root / "cameras", rig)
    np.savez(root / "neutral.npz", vertices_mm=model.neutral_mm)
    for name, camera in rig.items():
        plain = lip_patch.render(model, model.neutral_mm, camera, tattoo=False)
        write_image(root / f"plain/frames/{name}/000000.png", plain)
    for frame, pose in enumerate(POSES):
        for name, camera in rig.items():
            if frame == 0 or name == "front":
                image = lip_patch.render(model, lip_patch.vertices_at(*pose), camera, tattoo=True)
                write_image(root / f"rom/frames/{name}/{frame:06d}.png", image)
    run_script(
        "inpaint/plain_texture",
        wildcards={"subject": "s1"},
        params={"cfg": CFG, "take": "plain", "neutral": 0, "source": str(root / "plain")},
        input={n: root / f for n, f in shared().items() if n != "plain"},
        output={"texture": root / "plain.exr", "overlay": root / "plain.png"},
    )
    reference_of(root, root)
    return root


def reference_of(root, out) -> None:
    run_script(
        "inpaint/inpaint_reference",
        wildcards={"subject": "s1", "take": "rom"},
        params={"cfg": CFG, "neutral": 0, "source": str(root / "rom")},
        input={n: root / f for n, f in shared().items()},
        output={"reference": out / "reference.exr", "overlay": out / "reference.png"},
    )


def shared() -> dict[str, str]:
    return {
        "template": "template.npz",
        "cameras": "cameras",
        "neutral": "neutral.npz",
        "plain": "plain.exr",
    }


def paint(root, out, frames, meshes=None, source="rom"):
    chunk = f"{frames[0]:06d}-{frames[-1]:06d}"
    if meshes is None:
        meshes = np.stack([lip_patch.vertices_at(*POSES[frame]) for frame in frames])
    write_sequence(out / f"H/{chunk}.npy", meshes)
    run_script(
        "inpaint/inpaint",
        wildcards={"subject": "s1", "take": "rom", "chunk": chunk},
        params={"cfg": CFG, "frames": frames, "source": str(root / source)},
        input={
            **{n: root / f for n, f in shared().items()},
            "reference": root / "reference.exr",
            "meshes": out / f"H/{chunk}.npy",
        },
        output={
            "frames": out / chunk,
            "quality": out / f"quality/{chunk}.tsv",
            "overlay": out / f"overlay/{chunk}.png",
        },
    )
    return out / chunk


@pytest.fixture(scope="module")
def painted(capture, tmp_path_factory):
    """The whole take in one chunk."""
    return paint(capture, tmp_path_factory.mktemp("painted"), [0, 1, 2])


def test_frames_come_out_without_their_tattoo(capture, painted):
    model, camera = lip_patch.face_model(), lip_patch.cameras()["front"]
    for frame, pose in enumerate(POSES):
        truth = lip_patch.render(model, lip_patch.vertices_at(*pose), camera, tattoo=False)
        inked = read_image(capture / f"rom/frames/front/{frame:06d}.png")
        ours = read_image(painted / f"{frame:06d}.png")
        before = np.abs(to_display(inked).astype(int) - to_display(truth)).mean()
        after = np.abs(to_display(ours).astype(int) - to_display(truth)).mean()
        assert after < 0.1 * before  # levels of 8 bit
    rows = read_table(painted.parent / "quality/000000-000002.tsv")
    assert rows["valid"].all() and (rows["composited_px"] > 1000).all()
    assert (rows["border_levels8"] < 2.0).all()


def test_chunks_change_no_bit(capture, painted, tmp_path):
    parts = [paint(capture, tmp_path, frames) for frames in ([0], [1, 2])]
    made = [path for part in parts for path in part.iterdir()]
    assert len(made) == len(POSES)
    for path in made:
        assert path.read_bytes() == (painted / path.name).read_bytes()


def test_a_frame_is_read_once_and_its_mesh_is_one_ray_caster(capture, tmp_path, monkeypatch):
    reads, meshes, converted = Counter(), Counter(), Counter()
    counted(monkeypatch, "read_image", lambda path, *_, **__: reads.update([str(path)]))
    counted(monkeypatch, "linear_to_srgb", lambda x: converted.update(image_bytes(x)))
    whole = RayCaster.__init__

    def build(self, vertices_mm, triangles):
        meshes.update([np.asarray(vertices_mm, dtype=np.float64).tobytes()])
        whole(self, vertices_mm, triangles)

    monkeypatch.setattr(RayCaster, "__init__", build)
    paint(capture, tmp_path, [0, 1, 2])
    assert set(reads.values()) == {1} and len(reads) == 3
    assert set(meshes.values()) == {1}
    assert len(meshes) == 3 + 1  # the frames' meshes, and the chart of the domain
    assert set(converted.values()) == {1}  # no part of an image is converted to sRGB twice


def test_the_reference_bakes_each_view_once(capture, tmp_path, monkeypatch):
    reads, weighed = Counter(), Counter()
    counted(monkeypatch, "read_image", lambda path, *_, **__: reads.update([str(path)]))
    counted(monkeypatch, "_view_weight", lambda *args: weighed.update([args[2].name]))
    reference_of(capture, tmp_path)
    assert set(reads.values()) == {1}
    assert weighed == dict.fromkeys(lip_patch.cameras(), 1)
    assert (tmp_path / "reference.exr").read_bytes() == (capture / "reference.exr").read_bytes()


def image_bytes(values) -> list[bytes]:
    """The content of an image or a crop; nothing of the few colours of a palette."""
    return [np.asarray(values).tobytes()] if np.size(values) > 1000 else []


def counted(monkeypatch, name: str, count) -> None:
    """Call `count` with the arguments of every call of a function of Vermilion, wherever imported."""
    for module in list(sys.modules.values()):
        if getattr(module, "__name__", "").startswith("vermilion.") and name in vars(module):
            function = getattr(module, name)

            def wrapper(*args, function=function, **kwargs):
                count(*args, **kwargs)
                return function(*args, **kwargs)

            monkeypatch.setattr(module, name, wrapper)


def test_a_bad_frame_is_flagged_and_the_rest_goes_on(capture, tmp_path):
    broken = capture / "broken/frames/front"
    broken.mkdir(parents=True, exist_ok=True)
    for frame in (0, 1, 2):
        whole = (capture / f"rom/frames/front/{frame:06d}.png").read_bytes()
        (broken / f"{frame:06d}.png").write_bytes(whole[: 900 if frame == 1 else None])
    meshes = np.stack([lip_patch.vertices_at(*pose) for pose in POSES])
    meshes[2] = np.nan
    folder = paint(capture, tmp_path, [0, 1, 2], meshes, source="broken")
    assert [path.name for path in folder.iterdir()] == ["000000.png"]
    rows = read_table(tmp_path / "quality/000000-000002.tsv")
    assert list(rows["valid"]) == [1, 0, 0]
    assert "truncated" in rows["reason"][1] and "no mesh" in rows["reason"][2]
