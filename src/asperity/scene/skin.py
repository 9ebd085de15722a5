"""The table `[tool.skin]` of `scene.toml`: an elastic layer on the tool."""

from __future__ import annotations

from collections.abc import Sequence

from asperity.contact.soft.skin import SoftSkin
from asperity.errors import AsperityError
from asperity.geometry.bodies import Body
from asperity.scene.document import Table, arguments, at


def _keys(
    thickness: float,
    modulus: float,
    poisson: float = 0.45,
    taxels: Sequence[float] = (64, 64),
    facing: Sequence[float] = (0.0, 0.0, -1.0),
    size: Sequence[float] = (),
    middle: Sequence[float] = (),
    friction: float = 0.0,
) -> None:
    """Have the keys of the table as parameters; see `SoftSkin`."""


def tool_skin(table: Table, tool: str, bodies: Sequence[Body]) -> SoftSkin | None:
    """Return the skin of a scene's tool, None without one.

    Parameters
    ----------
    table : mapping
        `[tool.skin]`: `thickness` [m], `modulus` [Pa], `poisson`, `taxels` (rows, columns),
        `facing`, `size`, `middle` and `friction` of `SoftSkin`. By default it faces down.
    tool : str
    bodies : sequence of Body
        All bodies of the scene.

    Raises
    ------
    AsperityError
        A key or a value is wrong, or a body is a mesh.
    """
    if not table:
        return None
    given = arguments(table, "tool.skin", _keys)
    for body in bodies:
        if body.mesh is not None:
            raise AsperityError(
                f"tool.skin: body {body.name!r} is a mesh; a skin and what it meets are of simple "
                "geoms"
            )
    if len(bodies) < 2:
        raise AsperityError("tool.skin: there is no other body that it could meet")
    own = next(body for body in bodies if body.name == tool)
    return at("tool.skin", lambda: SoftSkin(own, **{"facing": (0.0, 0.0, -1.0), **given}))
