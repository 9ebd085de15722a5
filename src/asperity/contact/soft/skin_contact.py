"""Contact of a soft skin with other bodies: pressure and shear on its taxels, and the wrench."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from asperity._core.arrays import Array
from asperity._core.kernels import Repeated
from asperity.contact.soft.layer import LINEAR
from asperity.contact.soft.press import press
from asperity.contact.soft.skin import SoftSkin
from asperity.contact.soft.solids import fill_frames, require_bodies, solids_of
from asperity.contact.soft.taxel_sums import empty_output
from asperity.errors import AsperityError, require_finite
from asperity.geometry.bodies import Body
from asperity.geometry.poses import require_pose, rotation_of

_IDENTITY = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)


class SkinContact:
    """Contact of a soft skin with other bodies.

    The energy is `U = sum a w(delta)` over the taxels, with a the area, delta the compression, that
    is the depth of the other body's textured surface along a taxel's ray, and w the energy of the
    layer per area, `K delta^2 / 2` up to half of its thickness (`soft.layer`). Force and torque are
    minus its gradient. Friction, if the skin has any, is added: on each taxel
    `mu F / sqrt(v^2 + v0^2)` times the slip velocity v, with F the normal force and v0 = 5 mm/s.
    It dissipates energy at any speed; there is no static friction.

    Parameters
    ----------
    skin : SoftSkin
    bodies : sequence of Body
        The other bodies; meshes have to be closed.
    poses : sequence of (7,), optional
        Of the bodies' frames: position [m], unit quaternion wxyz. By default all are the world's.
    centre : (3,)
        Reference point of torques, in the frame of the skin's body [m].

    Raises
    ------
    AsperityError
        A mesh is open, or poses or centre are not finite.

    Examples
    --------
    >>> skin = SoftSkin(pad, thickness=2e-3, modulus=5e4, facing=(0, 0, -1))
    >>> contact = SkinContact(skin, [plate])
    >>> force, torque = np.split(contact.wrench(pose), 2)
    >>> contact.pressure.max()
    """

    def __init__(
        self,
        skin: SoftSkin,
        bodies: Sequence[Body],
        poses: Sequence[ArrayLike] | None = None,
        *,
        centre: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> None:
        require_bodies("a skin", bodies)
        self.skin = skin
        placed = [require_pose(p, "pose") for p in poses or [_IDENTITY] * len(bodies)]
        if len(placed) != len(bodies):
            raise AsperityError(f"there are {len(bodies)} bodies, but {len(placed)} poses")
        self.centre = np.array(require_finite("centre", centre, 3))
        self._solids = solids_of(bodies, placed)
        self._friction = float(skin.friction)
        self.out = empty_output(len(skin.arrays.area))
        """Results of the last pose; rows are taxels."""
        self._pose, self._twist = np.zeros((3, 4)), np.zeros(6)
        self._press = Repeated(press)

    def place(self, poses: Sequence[ArrayLike]) -> None:
        """Move the other bodies to new poses (7,), one for each."""
        fill_frames(self._solids, [require_pose(pose, "pose") for pose in poses])

    def wrench(
        self, pose: ArrayLike, twist: ArrayLike | None = None, *, about: ArrayLike | None = None
    ) -> Array:
        """Return the wrench on the skin's body at a pose.

        Parameters
        ----------
        pose : (7,)
            Of its frame: position [m], unit quaternion wxyz.
        twist : (6,), optional
            Velocity of the centre [m/s] and angular velocity [rad/s], world axes, for friction. By
            default it is at rest.
        about : (3,), optional
            Another centre from this pose on, in the frame of the skin's body [m].

        Returns
        -------
        (6,) array
            Force [N] and torque about the centre [N m], world axes.

        Raises
        ------
        AsperityError
            The pose or the twist has a wrong shape or is not finite.
        """
        place = require_pose(pose, "pose")
        self._twist[:] = 0.0 if twist is None else require_finite("twist", twist, 6)
        self._pose[:, :3] = rotation_of(place[3:])
        self._pose[:, 3] = place[:3]
        if about is not None:
            self.centre[:] = require_finite("about", about, 3)
        self._press(
            self._solids, self.skin.arrays, self._friction, self._pose, self.centre, self._twist,
            self.out,
        )  # fmt: skip
        return self.out.wrench.copy()

    @property
    def energy(self) -> float:
        """U of the last pose [J]."""
        return float(self.out.energy[0])

    def stiffness(self) -> Array:
        """Return the stiffness of the last pose (6, 6), in the Gauss-Newton approximation.

        About the centre, world axes [N/m, N/rad; N, N m/rad]; positive semidefinite. The curvature
        of the other surface, which can reduce it, is ignored.
        """
        return self.out.stiffness.copy()

    def damping(self) -> Array:
        """Return the damping of the friction at the last pose (6, 6), as `stiffness` [N s/m]."""
        return self.out.damping.copy()

    @property
    def compression(self) -> Array:
        """Compression of each taxel [m], (rows, columns)."""
        return self.skin.as_grid(self.out.compression)

    @property
    def pressure(self) -> Array:
        """Pressure along each taxel's ray [Pa], (rows, columns)."""
        return self.skin.as_grid(self.out.traction[:, 0])

    @property
    def shear(self) -> Array:
        """Traction along columns and rows, normal to each taxel's ray [Pa], (rows, columns, 2)."""
        return self.skin.as_grid(self.out.traction[:, 1:])

    @property
    def forces(self) -> Array:
        """Force on each taxel [N], world axes, (rows, columns, 3)."""
        return self.skin.as_grid(self.out.force)

    @property
    def points(self) -> Array:
        """Point of application of each taxel's force [m], world axes, (rows, columns, 3).

        For taxels without contact it is their own point; nan for cells without a taxel.
        """
        at_rest = self.skin.arrays.point @ self._pose[:, :3].T + self._pose[:, 3]
        is_pressed = (self.out.compression > 0.0)[:, None]
        return self.skin.as_grid(np.where(is_pressed, self.out.point, at_rest), np.nan)

    @property
    def contact_area(self) -> float:
        """Area of the taxels in contact [m^2]."""
        return float(self.skin.arrays.area[self.out.compression > 0.0].sum())

    @property
    def stiffened(self) -> int:
        """Number of taxels compressed by more than half of the thickness."""
        return int(np.count_nonzero(self.out.compression > LINEAR * self.skin.arrays.thickness))
