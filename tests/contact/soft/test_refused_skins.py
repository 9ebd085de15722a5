"""What a soft skin refuses, each in one line that names the value."""

import numpy as np
import pytest

from asperity.contact.soft.skin import SoftSkin
from asperity.contact.soft.skin_contact import SkinContact
from asperity.errors import AsperityError
from asperity.geometry.bodies import Body, Geom

PAD = Body("pad", [Geom("box", (1e-2, 1e-2, 5e-3))])
PLATE = Body("plate", [Geom("plane", (0.0, 0.0))])


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"modulus": -1.0}, "modulus"),
        ({"modulus": float("nan")}, "modulus"),
        ({"modulus": float("inf")}, "modulus"),
        ({"modulus": "soft"}, "modulus"),
        ({"poisson": 0.5}, "below 0.5"),
        ({"poisson": -0.1}, "poisson"),
        ({"poisson": float("nan")}, "poisson"),
        ({"thickness": 0.0}, "thickness"),
        ({"friction": -0.1}, "friction"),
        ({"taxels": (0, 4)}, "rows of taxels"),
        ({"taxels": (4, 1e6)}, "columns of taxels"),
        ({"taxels": (4.5, 4)}, "whole number"),
        ({"taxels": 64}, "taxels must be 2"),
        ({"facing": (0, 0, 0)}, "facing"),
        ({"facing": (0, float("nan"), 1)}, "facing"),
        ({"size": (1e-3, -1e-3)}, "size"),
        ({"middle": (1.0, 1.0, 1.0)}, "no taxel"),
        ({"body": PLATE}, "give the skin a size"),
    ],
)
def test_bad_values_are_named_in_one_line(changed, words):
    with pytest.raises(AsperityError) as refused:
        SoftSkin(**{"body": PAD, "thickness": 1e-3, "modulus": 1e5} | changed)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_plane_with_a_given_size_bears_a_skin():
    skin = SoftSkin(PLATE, 1e-3, 1e5, size=(0.02, 0.01), taxels=(4, 8))
    assert skin.as_grid(skin.arrays.area).sum() == pytest.approx(2e-4)
    assert skin.as_grid(skin.arrays.point)[3, 7, :2] == pytest.approx([0.00875, 0.00375])


def test_a_ball_bears_taxels_where_it_faces_the_grid():
    ball = Body("ball", [Geom("sphere", (5e-3,))])
    skin = SoftSkin(ball, 1e-3, 1e5, taxels=(101, 101), facing=(0, 0, -1))
    area = skin.as_grid(skin.arrays.area)
    assert area[0, 0] == 0.0
    # That of the cap down to a cosine of 0.2, 2 pi r^2 (1 - 0.2).
    assert area.sum() == pytest.approx(2.0 * np.pi * 25e-6 * 0.8, rel=0.02)
    np.testing.assert_allclose(skin.arrays.inwards, -skin.arrays.point / 5e-3, atol=1e-9)


@pytest.mark.parametrize(
    ("pose", "twist"),
    [
        ([0.0] * 7, None),
        ([0.0, 0.0, float("nan"), 1.0, 0.0, 0.0, 0.0], None),
        ([0.0, 0.0, 0.0], None),
        ([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], [float("inf")] * 6),
    ],
)
def test_bad_poses_are_refused(pose, twist):
    contact = SkinContact(SoftSkin(PAD, 1e-3, 1e5, taxels=(4, 4)), [PLATE])
    with pytest.raises(AsperityError):
        contact.wrench(pose, twist)


def test_bodies_and_poses_have_to_fit():
    skin = SoftSkin(PAD, 1e-3, 1e5, taxels=(4, 4))
    with pytest.raises(AsperityError, match="one body"):
        SkinContact(skin, [])
    with pytest.raises(AsperityError, match="1 bodies, but 2 poses"):
        SkinContact(skin, [PLATE], [(0, 0, 0, 1, 0, 0, 0)] * 2)
