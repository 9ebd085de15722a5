"""Columns of a file of poses that several lines above the rows name.

Motion capture writes the body above "Rotation" above "X", units in a line below the names, and the
number of a frame where others write a time.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import pairwise

from asperity._core.text_form import is_number
from asperity._core.text_table import TextTable
from asperity.errors import AsperityError
from asperity.scene.pose_columns import Layout, layout_of, meaning_of

_RATE = re.compile(r"\b(?:frame\W?rate|capture rate|frequency|fps)\b\W*(\d+\.?\d*)", re.IGNORECASE)
_ALONE = re.compile(r"(\d+\.?\d*)[\s,;]*")
_SECTIONS = ("objects", "segments", "trajectories", "joints", "model outputs")
"""Lines of Vicon's above the one of its frames in a second."""
_BODY = re.compile(r"(?i)(?:^|[\W_])(?:id|name|body|device|tracker|object|serial)$")
"""Names of columns that may tell bodies apart."""
_MOST_LINES = 20
"""Lines above the rows, the last ones, that may name columns."""
_COLMAP = ({"imageid", "cameraid"}, {"id", "cameraid"})
ROS2 = ("sec", "nanosec", "frame_id", "x", "y", "z", "qx", "qy", "qz", "qw")
"""Columns of `ros2 topic echo --csv` of poses with a time, which have no names."""
_FRAMES = ("frame", "frame#", "frames", "frame number", "sample")


def named_layout(
    path: object, text: TextTable, names: tuple[str, ...], rate: float | None = None
) -> Layout:
    """Return the layout of columns that lines above the rows name, with the time if one has it.

    `rate` are the frames in a second, by default those that the lines state.

    Raises
    ------
    AsperityError
        Columns that do not make a pose, or poses of several bodies; one line.
    """
    cells = (_cells(line, text.separator, len(names)) for line in text.header[-_MOST_LINES:])
    above = [line for line in cells if line is not None]
    rate = rate or frame_rate(text.header)
    made = [names, *(_joined(line, names) for line in reversed(above) if line != names)]
    errors: list[tuple[int, bool, AsperityError]] = []
    timeless = None
    for columns in made:
        try:
            layout = named_columns(path, columns, rate)
            if layout.places[0] >= 0:
                return layout
            timeless = timeless or layout
        except AsperityError as error:
            known = sum(meaning_of(name) is not None for name in columns)
            errors.append((known, "quaternions" in str(error), error))
    if timeless is not None:
        return timeless
    for line in above:
        bodies = dict(_bodies(path, line, made, rate))
        if len(bodies) == 1:
            return next(iter(bodies.values()))
        if bodies:
            raise AsperityError(
                f"{path}: poses of {len(bodies)} bodies, {', '.join(bodies)[:90]}; valid: one; "
                "keep its columns in the file, or name them by order=, with - for the others"
            )
    raise max(errors, key=lambda found: found[:2])[2]


def frame_rate(header: Sequence[str]) -> float | None:
    """Return the frames in a second that the lines above the rows state, None if none does."""
    before = ""
    for line in header:
        found = _RATE.search(line)
        if found is None and before in _SECTIONS:
            found = _ALONE.fullmatch(line)
        if found is not None and 0.0 < float(found.group(1)) < 1e6:
            return float(found.group(1))
        before = line.strip(" ,;\t").casefold()
    return None


def _cells(line: str, separator: str | None, count: int) -> tuple[str, ...] | None:
    """Return the cells of a line, "" for empty ones; None if it has more than the rows, or few."""
    cells = [cell.strip(" \"'") for cell in line.split(separator)]
    return (*cells, *[""] * (count - len(cells))) if 2 < len(cells) <= count else None


def _joined(line: Sequence[str], names: Sequence[str]) -> tuple[str, ...]:
    return tuple(f"{a} {b}".strip() for a, b in zip(line, names, strict=True))


def named_columns(path: object, names: Sequence[str], rate: float | None) -> Layout:
    """Return the layout of names; frames are times where nothing else is and their rate is known.

    Raises `AsperityError` if they do not make a pose.
    """
    frames = [at for at, name in enumerate(names) if name.casefold() in _FRAMES]
    if rate is None or not frames or any(meaning_of(name) == "time" for name in names):
        return layout_of(path, names)
    timed = [*names]
    timed[frames[0]] = "time"
    return layout_of(path, timed)._replace(rate=rate)


def of_the_world(path: object, header: Sequence[str], names: Sequence[str]) -> tuple[str, ...]:
    """Return a note on poses of the world in a camera, as COLMAP has them, () for others.

    Raises `AsperityError` for its list of images, which has lines of points between.
    """
    if any("POINTS2D" in line for line in header):
        raise AsperityError(
            f"{path}: COLMAP's images, which are poses of the world in the camera, without a time "
            "and a scale; valid: those of the tool in the world [m], as time,x,y,z,qw,qx,qy,qz"
        )
    plain = {re.sub(r"[\W_]", "", name).lower() for name in names}
    if not any(known <= plain for known in _COLMAP):
        return ()
    return ("are they poses of the world in a camera, as COLMAP's? Taken as those of the tool in "
            "the world, in m: invert and scale them, if so",)  # fmt: skip


def are_ros2(text: TextTable) -> bool:
    """Return whether columns without names are `ROS2`: two whole numbers, a word, and a pose."""
    cells = [cell.strip() for cell in text.body.partition("\n")[0].split(",")]
    return (
        len(cells) == text.columns == len(ROS2)
        and all(cell.isdigit() for cell in cells[:2])
        and not is_number(cells[2])
        and all(map(is_number, cells[3:]))
    )


def require_one_body(path: object, text: TextTable, names: Sequence[str]) -> None:
    """Raise `AsperityError` if a column names several bodies, whose poses stand by turns."""
    for at, name in enumerate(names):
        if not _BODY.search(name.strip()):
            continue
        lines = text.complete().body.split("\n")
        cells = [line.split(text.separator) for line in lines if line.strip()]
        owners = [cell[at].strip(" \"'") for cell in cells if len(cell) > at]
        bodies = dict.fromkeys(owners)
        changes = sum(a != b for a, b in pairwise(owners))
        if 1 < len(bodies) <= 0.25 * len(owners) and changes > 2 * len(bodies):  # else trials
            raise AsperityError(
                f"{path}: poses of {len(bodies)} bodies, {', '.join(bodies)[:90]}, as its column "
                f"{name!r} states; valid: those of one alone"
            )


def _bodies(
    path: object, line: Sequence[str], made: Sequence[Sequence[str]], rate: float | None
) -> Iterator[tuple[str, Layout]]:
    """Yield bodies that a line names, each above its first column or above all, and their poses."""
    owners, owner = [], ""
    for cell in line:
        owner = cell or owner
        owners.append(owner)
    for body in dict.fromkeys(owners):
        for names in made:
            own = [
                name if o in ("", body) or meaning_of(name) == "time" or n < 2 else ""
                for n, (name, o) in enumerate(zip(names, owners, strict=True))
            ]
            try:
                yield body, named_columns(path, own, rate)
                break
            except AsperityError:
                continue
