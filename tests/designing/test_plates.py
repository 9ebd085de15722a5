"""Plates as files: closed, as fine and as steep as wanted, and baked back to the same map."""

import numpy as np
import pytest
import trimesh

import asperity
from asperity.designing.plate_stl import (
    PrintedPlate,
    plate_map,
    plate_triangles,
    write_base,
    write_on_mesh,
    write_stl,
)
from asperity.designing.process import map_limits, process_of
from asperity.errors import AsperityError
from asperity.texture.height_field import HeightField
from asperity.texture.patterns.patterns import jittered_dots


def _to_make(process):
    field = jittered_dots(
        pitch=2e-3, height=2e-4, diameter=8e-4, flank=2.5e-4, periods=3, samples=40
    )
    samples = process.to_make(np.array(field.samples), field.pixel_size)
    return HeightField(samples, field.pixel_size, "wrap")


def _written(folder, process, plate):
    heights, strip = plate_map(_to_make(process), process, plate, "7")
    write_stl(plate_triangles(heights, process.pixel, plate.base), folder / "plate.stl")
    write_base(heights.shape, process.pixel, plate.base, folder / "base.obj")
    return heights, strip


def _top(mesh, shape, pixel):
    """Return the heights (rows, columns) [m] of the top of a plate's mesh."""
    places = mesh.vertices * 1e-3
    column = np.rint(places[:, 0] / pixel + 0.5 * (shape[1] - 1)).astype(int)
    row = np.rint(places[:, 1] / pixel + 0.5 * (shape[0] - 1)).astype(int)
    out = np.full(shape, -np.inf)
    inside = (row >= 0) & (row < shape[0]) & (column >= 0) & (column < shape[1])
    np.maximum.at(out, (row[inside], column[inside]), places[inside, 2])
    return out


@pytest.mark.parametrize("preset", ["sla", "mill", "fdm", "laser"])
def test_stl_is_closed_and_within_the_limits_of_its_process(tmp_path, preset):
    process = process_of(preset)
    plate = PrintedPlate((12e-3, 9e-3))
    heights, strip = _written(tmp_path, process, plate)
    mesh = trimesh.load(tmp_path / "plate.stl")
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0.0
    top = _top(mesh, heights.shape, process.pixel)
    assert np.allclose(top, heights, atol=1e-8)
    whole = map_limits(top, (process.pixel,) * 2, wraps=False)
    assert whole.slope <= process.slope
    assert whole.relief <= process.relief + 1e-9
    texture = map_limits(top[strip:], (process.pixel,) * 2, wraps=False)
    assert texture.feature >= 0.95 * process.feature
    assert strip * process.pixel == pytest.approx(plate.strip, abs=process.pixel)


def test_a_large_plate_is_small_enough_to_send(tmp_path):
    process = process_of("sla")
    heights, _ = _written(tmp_path, process, PrintedPlate((50e-3, 50e-3)))
    assert heights.shape[1] == 1000
    assert (tmp_path / "plate.stl").stat().st_size < 200e6


@pytest.mark.slow
def test_plate_is_baked_back_to_its_map(tmp_path):
    pytest.importorskip("embreex")
    pytest.importorskip("xatlas")
    pytest.importorskip("coacd")
    process = process_of("sla")
    heights, _ = _written(tmp_path, process, PrintedPlate((12e-3, 12e-3)))
    baked = asperity.bake(
        tmp_path / "plate.stl", tmp_path / "baked", base=tmp_path / "base.obj", unit="mm", up="z",
        faces=20, size=2048, picture=False,
    )  # fmt: skip
    [body] = [body for body in baked.scene.bodies if body.name == "object"]
    found = _baked_heights(body, heights.shape, process.pixel)
    inner = (slice(6, -6), slice(6, -6))
    assert np.std((found - heights)[inner]) < 0.01 * np.std(heights)


def _baked_heights(body, shape, pixel):
    """Return what a baked plate has at the samples of its map: texture over the base's top."""
    mesh, field = body.mesh, body.fields[0]
    rows, columns = shape
    x = (np.arange(columns) - 0.5 * (columns - 1)) * pixel
    y = (np.arange(rows) - 0.5 * (rows - 1)) * pixel
    places = np.stack([*np.meshgrid(x, y)], axis=-1).reshape(-1, 2)
    out = np.full(len(places), np.nan)
    for face, uv in zip(mesh.faces, mesh.uv, strict=True):
        corners = mesh.vertices[face]
        if np.abs(corners[:, 2]).max() > 1e-9:
            continue
        sides = np.column_stack([corners[1, :2] - corners[0, :2], corners[2, :2] - corners[0, :2]])
        if abs(np.linalg.det(sides)) < 1e-15:
            continue
        share = np.linalg.solve(sides, (places - corners[0, :2]).T).T
        inside = (share.min(axis=1) >= -1e-9) & (share.sum(axis=1) <= 1.0 + 1e-9)
        at = uv[0] + share[inside] @ np.stack([uv[1] - uv[0], uv[2] - uv[0]])
        out[inside] = field.heights(at[:, 0] * field.size[0], at[:, 1] * field.size[1])
    return out.reshape(shape)


def test_a_surface_on_a_given_mesh_is_closed(tmp_path):
    process = process_of("sla", pixel=3e-4, feature=6e-4)
    trimesh.creation.icosphere(3, 8.0).export(tmp_path / "ball.stl")
    field = _to_make(process)
    done = write_on_mesh(tmp_path / "ball.stl", field, process, tmp_path)
    mesh = trimesh.load(tmp_path / "object.stl")
    assert mesh.is_watertight
    assert done["longest_edge"] <= process.pixel
    grown = np.linalg.norm(mesh.vertices, axis=1) - 8.0
    assert grown.max() == pytest.approx(1e3 * field.relief, rel=0.15)


def test_an_open_mesh_is_refused(tmp_path):
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    sheet.export(tmp_path / "sheet.obj")
    process = process_of("sla")
    with pytest.raises(AsperityError, match="open"):
        write_on_mesh(tmp_path / "sheet.obj", _to_make(process), process, tmp_path)


def test_bad_plates_and_processes_are_refused():
    with pytest.raises(AsperityError, match="size of a plate"):
        PrintedPlate((1.0, 0.05))
    with pytest.raises(AsperityError, match="feature"):
        process_of("sla", feature=1e-6)
    with pytest.raises(AsperityError, match="did you mean 'layer'"):
        process_of("sla", layers=1e-4)
    with pytest.raises(AsperityError, match="samples"):
        plate_map(_to_make(process_of("sla")), process_of("laser"), PrintedPlate((0.4, 0.4)), "1")
