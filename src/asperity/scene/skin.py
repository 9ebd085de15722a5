"""The tables `[tool.skin]` and `[bodies.NAME.skin]` of `scene.toml`: an elastic layer on a body."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from asperity.contact.soft.skin import SoftSkin
from asperity.contact.soft.solids import refuse_property_maps
from asperity.errors import AsperityError
from asperity.geometry.bodies import Body
from asperity.scene.document import Table, arguments, at

if TYPE_CHECKING:
    from asperity.scene.scene import Scene


def _keys(
    thickness: float,
    modulus: float,
    poisson: float = 0.45,
    taxels: Sequence[float] = (64, 64),
    facing: Sequence[float] = (),
    size: Sequence[float] = (),
    middle: Sequence[float] = (),
    friction: float = 0.0,
    lumps: Sequence[float] = (),  # lists of numbers: see `_lumps`
) -> None:
    """Have the keys of the table as parameters; see `SoftSkin`."""


def scene_skin(document: Table, tool: str, bodies: Sequence[Body]) -> SoftSkin | None:
    """Return the skin of a scene, None without one.

    Parameters
    ----------
    document : mapping
        Contents of `scene.toml`. `[tool.skin]` or `[bodies.NAME.skin]` has `thickness` [m],
        `modulus` [Pa], `poisson`, `taxels` (rows, columns), `facing`, `size`, `middle`, `friction`
        and `lumps` of `SoftSkin`. By default that of the tool faces down, that of a body up.
    tool : str
    bodies : sequence of Body
        All bodies of the scene.

    Raises
    ------
    AsperityError
        A key or a value is wrong, the body with the skin is a mesh, or there are two skins, or a
        body beside the tool and one with a skin.
    """
    tables = {"tool.skin": (tool, document["tool"].get("skin"))}
    for name, part in document.get("bodies", {}).items():
        tables[f"bodies.{name}.skin"] = (name, part.get("skin"))
    found = [(key, name, table) for key, (name, table) in tables.items() if table]
    if not found:
        return None
    (key, bearer, table), *more = found
    if more:
        raise AsperityError(f"{key} and {more[0][0]}: a scene has one soft skin; leave one out")
    if key != "tool.skin" and bearer == tool:
        raise AsperityError(f"{key}: {tool!r} is the tool; its skin is [tool.skin]")
    given = arguments({k: v for k, v in table.items() if k != "lumps"}, key, _keys)
    if "lumps" in table:
        given["lumps"] = _lumps(table["lumps"], f"{key}.lumps")
    at(key, lambda: refuse_property_maps(bodies))
    others = [body.name for body in bodies if body.name not in (bearer, tool)]
    if bearer == tool and not others:
        raise AsperityError(f"{key}: there is no other body that it could meet")
    if bearer != tool and others:
        raise AsperityError(
            f"{key}: the tool of such a scene meets {bearer!r} alone, and there is {others[0]!r}; "
            'leave it out, or have it only seen (contype="0" conaffinity="0")'
        )
    facing = (0.0, 0.0, -1.0 if bearer == tool else 1.0)
    own = next(body for body in bodies if body.name == bearer)
    return at(key, lambda: SoftSkin(own, **{"facing": facing, **given}))


def require_rigid(scene: Scene, what: str) -> None:
    """Raise `AsperityError` for a scene with a soft body, which `what` would leave out."""
    kind = "a soft skin" if scene.skin is not None else "an elastic body"
    if scene.soft is not None:
        raise AsperityError(
            f"{scene.name} has {kind}, and {what}; valid: scenes without a table named skin or "
            "elastic"
        )


def _lumps(value: Any, key: str) -> Sequence[Any]:
    """Return a list of lists, or refuse it; their numbers are checked by `SoftSkin`."""
    if not isinstance(value, Sequence) or not all(isinstance(one, Sequence) for one in value):
        raise AsperityError(f"{key} must be a list of lists [x, y, z, radius] in m, got {value!r}")
    return value
