"""Relief from images and smooth meshes: found, averaged, and the same for any chunks."""

import numpy as np
import pytest

from tests.stages.run_script import run_script
from tests.stages.test_detail import CAMERA, MODEL, write_take
from vermilion.appearance.harmonics import irradiance
from vermilion.config.detail import DetailConfig
from vermilion.geometry.mesh import vertex_normals
from vermilion.geometry.mesh_files import read_mesh
from vermilion.geometry.raycast import RayCaster, interpolate
from vermilion.imaging.images import read_channels, read_image
from vermilion.storage.sequences import read_sequence
from vermilion.storage.tables import read_table

N_FRAMES = 6


def with_wrinkle(frame):
    """The sheet, on which a wrinkle comes up from frame 2 on."""
    points = MODEL.neutral_mm.astype(float)
    wrinkle = 0.25 * max(frame - 1, 0) * np.exp(-((points[:, 0] - 8) ** 2) / (2 * 4.0**2))
    wrinkle *= np.abs(points[:, 1]) < 30
    return points + wrinkle[:, None] * vertex_normals(points, MODEL.triangles)


def render(vertices):
    hits = RayCaster(vertices, MODEL.triangles).see(CAMERA)
    normals = interpolate(hits, MODEL.triangles, vertex_normals(vertices, MODEL.triangles))
    light = np.zeros((9, 3))
    light[0], light[2], light[3] = 0.8, -0.4, 0.6
    shaded = 0.35 * irradiance(normals @ CAMERA.rotation.T, light)
    return np.where(hits.hit[..., None], shaded, 0.1)


def prepare(root, sizes, missing=()):
    coarse = np.repeat(MODEL.neutral_mm[None], N_FRAMES, axis=0)
    return write_take(root, sizes, coarse, lambda f: render(with_wrinkle(f)), missing)


def run_stage(root, paths):
    relief = DetailConfig(
        relief={"levels": 0, "light_frames": 2, "map_px": 32, "noise_floor": 0.5}
    ).relief.model_dump(mode="json")
    params = {
        "cfg": {f"detail.relief.{key}": value for key, value in relief.items()},
        "source": str(root), "span": [0, N_FRAMES - 1],
    }  # fmt: skip
    files = {"tracker": root / "tracker.npz", "fit": root / "fit.npz", "meshes": paths}
    out = root / "relief"
    files["light"] = out / "light.npz"
    place = {"subject": "s", "take": "t"}
    files["start"] = out / "light_start.npz"
    made = {"light": files["start"], "topology": out / "topology.obj"}
    run_script("detail/relief_start", wildcards=place, params=params, input=files, output=made)
    evidence = [out / "light" / f"{path.stem}.npz" for path in paths]
    for part in evidence:
        first, last = (int(n) for n in part.stem.split("-"))
        params["frames"] = list(range(first, last + 1))
        made = {"evidence": part}
        run_script(
            "detail/relief_evidence", wildcards=place, params=params, input=files, output=made
        )
    inputs, made = {**files, "evidence": evidence}, {"light": files["light"]}
    run_script("detail/relief_light", wildcards=place, params=params, input=inputs, output=made)
    reliefs = [out / "relief" / f"{path.stem}.npz" for path in paths]
    for relief in reliefs:
        first, last = (int(n) for n in relief.stem.split("-"))
        params["frames"] = list(range(first, last + 1))
        made = {"relief": relief}
        run_script("detail/relief", wildcards=place, params=params, input=files, output=made)
    for path in paths:
        first, last = (int(n) for n in path.stem.split("-"))
        params["frames"] = list(range(first, last + 1))
        made = {
            "meshes": out / path.name,
            "maps": out / "normals" / path.stem,
            "displacements": out / "displacements" / path.stem,
            "quality": out / f"quality{path.stem}.tsv",
            "overlay": out / f"overlay{path.stem}.png",
            "start": out / f"before{path.stem}.tsv",
            "after": out / f"after{path.stem}.tsv",
        }
        inputs = {**files, "reliefs": reliefs}
        run_script(
            "detail/relief_meshes", wildcards=place, params=params, input=inputs, output=made
        )
    return read_sequence([out / path.name for path in paths])


@pytest.mark.slow
def test_wrinkle_is_found_whatever_the_chunks(tmp_path):
    paths = prepare(tmp_path / "one", [N_FRAMES])
    whole = run_stage(tmp_path / "one", paths)
    parts = run_stage(tmp_path / "two", prepare(tmp_path / "two", [3, N_FRAMES - 3]))
    assert (parts == whole).all()

    true = vertex_normals(with_wrinkle(5), MODEL.triangles)
    smooth = vertex_normals(MODEL.neutral_mm.astype(float), MODEL.triangles)
    found = vertex_normals(whole[5].astype(float), MODEL.triangles)
    places = MODEL.neutral_mm
    near = (np.abs(places[:, 0] - 8) < 10) & (np.abs(places[:, 1]) < 20)

    def error_deg(normals):
        return np.degrees(np.arccos(np.clip((normals * true).sum(axis=1), -1, 1)))[near].mean()

    assert error_deg(found) < 0.7 * error_deg(smooth)
    out, name = tmp_path / "one" / "relief", f"000000-{N_FRAMES - 1:06d}"
    before = read_table(out / f"before{name}.tsv", ["frame", "residual"])
    after = read_table(out / f"after{name}.tsv", ["frame", "residual"])
    assert (after["residual"][3:] < before["residual"][3:]).all()
    assert list(after["learnt_from"]) == [1, 1, 0, 0, 0, 0]
    assert read_image(out / f"overlay{name}.png").std() > 0
    assert len(read_mesh(out / "topology.obj").vertices_mm) == whole.shape[1]
    maps = [read_channels(out / "normals" / name / f"{f:06d}.exr") for f in (0, 5)]
    assert np.abs(maps[0]["R"] - 0.5).max() < 0.3 * np.abs(maps[1]["R"] - 0.5).max()


def test_frame_without_image_is_flagged(tmp_path):
    paths = prepare(tmp_path, [N_FRAMES], missing=(3,))
    found = run_stage(tmp_path, paths)
    assert np.isfinite(found).all()
    rows = read_table(tmp_path / "relief" / f"quality{paths[0].stem}.tsv").set_index("frame")
    assert rows.loc[3, "valid"] == 0 and "no relief" in rows.loc[3, "reason"]
    assert rows["valid"].sum() == N_FRAMES - 1


def test_even_window_is_refused():
    with pytest.raises(ValueError, match="odd"):
        DetailConfig(relief={"window": 4})
