"""Asperity's contact of the displaced surfaces as plain meshes."""

from __future__ import annotations

import numpy as np
import pytest
from flat_foot import PLACES, at_place, centre_of_pressure, foot_on_smooth_plate
from flat_scenes import foot_scene

from asperity.errors import AsperityError
from asperity.studies.baselines import METHODS
from asperity.studies.baselines.asperity_meshes import MeshedMethod, meshed_body
from asperity.studies.comparison import stimuli
from asperity.studies.comparison.measures import tangential_rms


def test_its_depth_is_that_of_asperity_with_a_texture():
    scene = stimuli.ball_on_plate()
    poses = stimuli.straight_path(scene, 0.25)
    poses[:, 2] -= 2e-4
    own, meshed = METHODS["asperity"].prepare(scene), METHODS["asperity-meshes"].prepare(scene)
    both = [(own.wrench(pose), meshed.wrench(pose)) for pose in poses]
    # The sagitta of a chord of a twelfth of a wave is 3.4 um.
    assert max(abs(a.depth - b.depth) for a, b in both) < 5e-6
    a, b = (np.array([pair[k].force for pair in both]) for k in (0, 1))
    assert tangential_rms(a - b) < 0.25 * tangential_rms(a)


@pytest.mark.parametrize("plate", ["1", "4", "mesh 1", "mesh 32"])
def test_a_flat_foot_is_felt_under_its_middle(plate):
    flat = foot_on_smooth_plate()
    scene = foot_scene(plate)
    renderer = METHODS["asperity-meshes"].prepare(scene)
    start = scene.start.copy()
    for depth, (x, y) in zip((1e-4, 3e-4, 2e-4), PLACES, strict=True):
        pose = at_place(flat, x, y, depth)
        pose[:3] += [start[0], start[1], 1e-3 - (flat.start[2] - 2e-4)]
        felt = renderer.wrench(pose)
        wanted = scene.force.stiffness * depth
        np.testing.assert_allclose(felt.force, [0.0, 0.0, wanted], atol=1e-3 * wanted)
        assert np.abs(centre_of_pressure(felt)).max() < 5e-5


def test_what_has_no_texture_stays_as_it_is():
    tool, plate = (
        next(body for body in stimuli.ball_on_plate().bodies if body.name == name)
        for name in ("probe", "plate")
    )
    assert meshed_body(tool, 500) is tool
    meshed = meshed_body(plate, 500)
    assert meshed.texture is None
    assert len(meshed.mesh.faces) > 500


def test_points_out_of_range_are_refused():
    with pytest.raises(AsperityError, match="points must lie between 100 and 200000"):
        MeshedMethod(points=5)
