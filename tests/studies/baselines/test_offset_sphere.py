"""The offset surface of a sphere: its curvature, and the force along its normal."""

import numpy as np
import pytest

from asperity.errors import AsperityError
from asperity.geometry.bodies import Body, Geom
from asperity.scene.builtin import load_scene
from asperity.scene.scene import scene_of
from asperity.studies.baselines.asperity_laws import ASPERITY
from asperity.studies.baselines.offset_sphere import OFFSET_SPHERE, OffsetSurface
from asperity.texture.patterns.patterns import sinusoid


def test_crests_widen_by_the_radius_and_troughs_narrow():
    # Okamura & Cutkosky: a bump of radius rho is traced with rho + r, a trough with rho - r.
    amplitude, wave, r = 0.1e-3, 10e-3, 1.0e-3
    rho = 1.0 / (amplitude * (2 * np.pi / wave) ** 2)
    texture = sinusoid(wavelength=wave, amplitude=amplitude)
    plate = Body("plate", [Geom("box", [0.02, 0.02, 2e-3])], texture)
    surface = OffsetSurface(plate, r)
    x = np.linspace(0.0, wave, 401)
    traced = np.array([surface.at(u, 0.0) for u in x])
    bend = np.gradient(traced[:, 1], x)[5:-5]
    assert bend.min() == pytest.approx(-1.0 / (rho + r), rel=0.01)
    assert bend.max() == pytest.approx(1.0 / (rho - r), rel=0.01)
    assert np.gradient(traced[:, 0], x)[5:-5] == pytest.approx(traced[5:-5, 1], abs=2e-4)
    assert np.ptp(traced[:, 0]) == pytest.approx(2 * amplitude, rel=1e-3)


def test_beside_ours_it_is_smaller_by_the_slope_and_points_the_same_way():
    scene = load_scene("probe-plate")
    theirs, own = OFFSET_SPHERE.prepare(scene), ASPERITY.prepare(scene)
    steepest = 0.0
    for x in np.linspace(-0.02, -0.0185, 12):
        pose = np.array([x, 1e-3, 1.5e-3 - 0.2e-3, 1.0, 0.0, 0.0, 0.0])
        a, b = theirs.wrench(pose), own.wrench(pose)
        assert a.depth == pytest.approx(b.depth, abs=1e-9)
        slope = np.hypot(*b.force[:2]) / b.force[2]
        assert a.force * (1.0 + slope**2) == pytest.approx(b.force, rel=1e-5, abs=1e-7)
        steepest = max(steepest, slope)
    assert steepest > 0.2


def test_a_smooth_plate_is_a_plain_spring():
    scene = load_scene("probe-plate")
    document = {key: value for key, value in scene.document.items() if key != "bodies"}
    smooth = scene_of(scene.xml, document, name="smooth")
    felt = OFFSET_SPHERE.prepare(smooth).wrench(np.array([0.0, 0.0, 1.3e-3, 1.0, 0, 0, 0]))
    assert felt.force == pytest.approx([0.0, 0.0, scene.force.stiffness * 0.2e-3])
    above = OFFSET_SPHERE.prepare(smooth).wrench(np.array([0.0, 0.0, 1.6e-3, 1.0, 0, 0, 0]))
    assert above.contacts == 0
    beside = OFFSET_SPHERE.prepare(smooth).wrench(np.array([0.2, 0.0, 1.3e-3, 1.0, 0, 0, 0]))
    assert beside.contacts == 0


def test_the_force_goes_through_the_middle_of_the_sphere():
    felt = OFFSET_SPHERE.prepare(load_scene("probe-plate"))
    pose = np.array([-0.0193, 0.0, 1.35e-3, 1.0, 0.0, 0.0, 0.0])
    wrench = felt.wrench(pose)
    middle = -felt._centre
    assert wrench.torque == pytest.approx(np.cross(middle, wrench.force))


def test_what_is_no_sphere_is_refused():
    with pytest.raises(AsperityError, match="cannot render scene"):
        OFFSET_SPHERE.prepare(load_scene("hammer-blocks"))
    assert OFFSET_SPHERE.can(load_scene("probe-plate-dots")) is None
