"""Angles, rotation vectors and matrices of a file of poses, made quaternions.

Three angles do not show in which order they turn, and twelve numbers hardly whether they
are a matrix: what is taken is noted, with the option that changes it.
"""

from __future__ import annotations

from itertools import permutations

import numpy as np

from asperity._core.arrays import Array
from asperity.errors import AsperityError, require_choice
from asperity.scene.pose_columns import Layout

SEQUENCES = tuple("".join(axes) for axes in permutations("xyz"))
CONVENTIONS = ("rotvec", *SEQUENCES, *(axes.upper() for axes in SEQUENCES))
"""Rotation vectors; or angles about fixed axes, in this order, or (upper case) moving ones."""
ANGLE_UNITS = {"rad": 1.0, "deg": np.pi / 180.0}
_OFF = 0.02
"""Largest deviation of a rotation matrix from an orthonormal one that is taken for rounding."""
_EXACT = 1e-6
_LAST = (0.0, 0.0, 0.0, 1.0)
"""Last row of a (4, 4) matrix."""
_MATRIX = "valid: rows of (3, 4) or (4, 4) whose (3, 3) part is a rotation, one scale"


def in_quaternions(
    path: object, values: Array, layout: Layout, angles: str | None, unit: str | None
) -> tuple[Array, list[str]]:
    """Return columns of a layout as time, x, y, z, qw, qx, qy, qz, and notes on how.

    Parameters
    ----------
    path : path
    values : (n, k) array
        As `Layout.places` has the columns.
    layout : Layout
    angles : str, optional
        One of `CONVENTIONS`; by default as the names state, or usual.
    unit : str, optional
        One of `ANGLE_UNITS`; by default as the names state.

    Raises
    ------
    AsperityError
        Angles whose unit nothing states; matrices that do not turn; an option that is not needed.
    """
    if layout.turn in ("quaternion", "matrix"):
        for name, given in (("angles", angles), ("angle_unit", unit)):
            if given is not None:
                raise AsperityError(f"{path}: {name}= is for angles, but it has none; leave it out")
    if layout.turn == "quaternion":
        return values, []
    if layout.turn == "matrix":
        return _of_matrices(path, values)
    return _of_angles(path, values, layout, angles, unit)


def _of_matrices(path: object, values: Array) -> tuple[Array, list[str]]:
    from scipy.spatial.transform import Rotation  # slow to import

    notes = []
    if values.shape[1] == 17:  # named: the place may stand in the last row
        four = values[:, 1:].reshape(-1, 4, 4)
        if not _same(four[:, 3]) and _same(four[:, :, 3]):
            four = four.transpose(0, 2, 1)
            notes.append("the place is in the last row of its matrices: they are transposed")
        if not _same(four[:, 3]):
            raise AsperityError(f"{path}: the last row of its matrices is not 0 0 0 1; {_MATRIX}")
        rows = four[:, :3]
    else:
        rows = values[:, 1:].reshape(-1, 3, 4)
    turns = rows[:, :, :3]
    off = _off(turns)
    if not off <= _OFF:
        raise AsperityError(f"{path}: its matrices are no rotations ({_how(off)}); {_MATRIX}")
    rounded = f", off rotations by up to {off:.2g}," if off > _EXACT else ""
    notes.append(f"matrices{rounded} are turned into quaternions")
    quaternions = Rotation.from_matrix(turns).as_quat()
    return _table(values[:, 0], rows[:, :, 3], quaternions), notes


def _off(turns: Array) -> float:
    """Return how far matrices (n, 3, 3) are from rotations, infinite for a mirrored one."""
    if not np.isfinite(turns).all() or (np.linalg.det(turns) <= 0.0).any():
        return np.inf
    return float(np.abs(turns @ turns.transpose(0, 2, 1) - np.eye(3)).max())


def _how(off: float) -> str:
    """Return what is wrong with matrices that are off rotations."""
    return f"off by {off:.3g}" if np.isfinite(off) else "mirrored, flat, or no numbers"


def _of_angles(
    path: object, values: Array, layout: Layout, convention: str | None, unit: str | None
) -> tuple[Array, list[str]]:
    from scipy.spatial.transform import Rotation

    notes: list[str] = []
    names = "roll, pitch, yaw" if layout.turn == "roll" else "rx, ry, rz"
    radians = ANGLE_UNITS[require_choice("angle_unit", unit, ANGLE_UNITS)] if unit else None
    stated = layout.angle_unit
    if radians is not None and stated is not None and stated != radians:
        notes.append(f"angles in {unit}, as given; the file states otherwise")
    radians = radians or stated
    found = values[:, 4:7]
    largest = float(np.abs(found).max())
    if radians is None and 2.02 * np.pi < largest < np.inf:
        radians = ANGLE_UNITS["deg"]
        notes.append(f"angles reach {largest:.4g}: in degrees; angle_unit='rad' changes that")
    degrees = radians is not None and radians not in (1.0, 1e-3)
    if convention is None:
        vectors = layout.turn == "vector" or (layout.turn == "either" and not degrees)
        convention = layout.sequence or ("rotvec" if vectors else "xyz")
        other = "'xyz'" if convention == "rotvec" else "'zyx'"
        other += ", 'rotvec'" if layout.turn == "either" and degrees else ""
        notes.append(f"{_meaning(names, convention)}; angles={other} and others change that")
    require_choice("angles", convention, CONVENTIONS)
    if radians is None:
        if convention != "rotvec" or not float(np.linalg.norm(found, axis=1).max()) < 2.02 * np.pi:
            raise AsperityError(
                f"{path}: are {names} in degrees or radians? Nothing states it; valid: "
                "angle_unit='deg' or 'rad', `roll [deg]` as a name, or quaternions (qw, qx, qy, qz)"
            )
        radians = 1.0
        notes.append("angles in rad; angle_unit='deg' changes that")
    elif not degrees and radians * largest > 4.0 * np.pi:
        notes.append(f"are the angles in rad? They reach {largest:.4g}; angle_unit='deg' if not")
    found = radians * found
    if not np.isfinite(found).all():
        row = int(np.argmin(np.isfinite(found).all(axis=1)))
        raise AsperityError(f"{path}: the angles of pose {row} are not finite; valid: numbers")
    if convention == "rotvec":
        turns = Rotation.from_rotvec(found)
    else:
        order = ["xyz".index(axis) for axis in convention.lower()]
        turns = Rotation.from_euler(convention, found[:, order])
    return _table(values[:, 0], values[:, 1:4], turns.as_quat()), notes


def _meaning(names: str, convention: str) -> str:
    if convention == "rotvec":
        return f"{names} are taken as rotation vectors (as of UR robots)"
    about = ", ".join(convention.lower())
    if convention.isupper():
        return f"{names} are taken as angles about moving axes, {about} in turn"
    usual = " (Rz Ry Rx, as of ROS and URDF)" if convention == "xyz" else ""
    return f"{names} are taken as angles about fixed axes, {about} in turn{usual}"


def _table(times: Array, places: Array, xyzw: Array) -> Array:
    return np.column_stack([times, places, np.roll(xyzw, 1, axis=1)])


def matrix_layout(path: object, values: Array, order: str | None) -> tuple[Layout, list[str]]:
    """Return the layout of 12 or 16 numbers a row without names, a time before them or not.

    Parameters
    ----------
    path : path
    values : (n, 12), (n, 13), (n, 16) or (n, 17) array
    order : str, optional
        One of `MATRICES`; by default a (4, 4) matrix itself shows it.

    Raises
    ------
    AsperityError
        Numbers that are no such matrices; one line.
    """
    count = values.shape[1]
    first = count % 4
    numbers = values[:, first:]
    by_rows = np.arange(12)
    by_columns = np.arange(12).reshape(3, 4)
    by_columns = (by_columns // 4 + (count - first) // 4 * (by_columns % 4)).ravel()
    if count - first == 12:
        by_columns = np.array([0, 3, 6, 9, 1, 4, 7, 10, 2, 5, 8, 11])
    fits = {
        "matrix": count < 16 or _same(numbers[:, 12:]),
        "matrix-columns": count < 16 or _same(numbers[:, 3::4]),
    }
    chosen = order or ("matrix" if count < 16 or fits["matrix"] else "matrix-columns")
    places = by_rows if chosen == "matrix" else by_columns
    off = _off(numbers[:, places].reshape(-1, 3, 4)[:, :, :3])
    if not fits[chosen] or not off <= _OFF:
        why = "the last row is not 0 0 0 1" if not fits[chosen] else f"its turn: {_how(off)}"
        names = "time, x, y, z, qw, qx, qy, qz"
        raise AsperityError(
            f"{path}, line 1: {count} numbers that are no matrix ({why}); valid: 8 ({names}), "
            "matrices of 12 or 16 (KITTI), or names above"
        )
    notes = []
    if order is None:
        stored = "row by row" if chosen == "matrix" else "column by column"
        both = all(fits.values()) and count >= 16
        doubt = "; or column by column? order='matrix-columns' changes that" if both else ""
        notes = [f"{count} numbers without names: taken as matrices {stored}{doubt}"]
    return Layout((first - 1, *(first + places).tolist()), turn="matrix"), notes


def _same(numbers: Array) -> bool:
    return bool(np.allclose(numbers, _LAST, rtol=0.0, atol=1e-6))


def are_blocks(values: Array) -> bool:
    """Return whether rows of four numbers are (4, 4) matrices, one below the other."""
    return values.shape[1] == 4 and len(values) % 4 == 0 and _same(values[3::4])
