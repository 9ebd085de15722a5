"""The table `[bodies.NAME.elastic]` of `scene.toml`: a linear-elastic body under a rigid tool."""

from __future__ import annotations

from collections.abc import Sequence
from inspect import signature

from asperity.contact.deformable.elastic_solid import ElasticSolid
from asperity.contact.soft.solids import refuse_property_maps
from asperity.errors import AsperityError
from asperity.geometry.bodies import Body
from asperity.scene.document import Table, arguments, at

ANTI_ALIAS_NOTE = (
    "force.anti_alias: off, since an elastic body moves on with every pose; its taxels average "
    "waves shorter than their pitch"
)


def _keys(
    modulus: float,
    poisson: float = 0.4,
    density: float = 1000.0,
    damping: float = 0.1,
    modes: int = 30,
    fixed: str = "bottom",
    fixed_depth: float = 0.0,
    spacing: float = 0.0,
    friction: float = 0.0,
    layer_thickness: float = 0.0,
    layer_modulus: float = 0.0,
    pitch: float = 0.0,
) -> None:
    """Have the keys of the table as parameters; see `ElasticSolid`."""


def scene_elastic(document: Table, tool: str, bodies: Sequence[Body]) -> ElasticSolid | None:
    """Return the elastic body of a scene, None without one.

    Parameters
    ----------
    document : mapping
        Contents of `scene.toml`. `[bodies.NAME.elastic]` has the parameters of `ElasticSolid`.
    tool : str
    bodies : sequence of Body
        All bodies of the scene.

    Raises
    ------
    AsperityError
        A key or a value is wrong, or there is a skin, a second elastic body or
        another body beside the tool and the elastic one.
    """
    parts = document.get("bodies", {})
    found = [name for name, part in parts.items() if part.get("elastic") is not None]
    if not found:
        return None
    name, *more = found
    key = f"bodies.{name}.elastic"
    skins = ["tool.skin"] if document["tool"].get("skin") else []
    skins += [f"bodies.{other}.skin" for other, part in parts.items() if part.get("skin")]
    if more or skins:
        other = f"bodies.{more[0]}.elastic" if more else skins[0]
        raise AsperityError(f"{key} and {other}: a scene has one soft body; leave one out")
    if name == tool:
        raise AsperityError(f"{key}: {tool!r} is the tool; valid: a body that does not move")
    given = arguments(parts[name]["elastic"], key, _keys)
    others = [body.name for body in bodies if body.name not in (name, tool)]
    if others:
        raise AsperityError(
            f"{key}: the tool of such a scene meets {name!r} alone, and there is {others[0]!r}; "
            'leave it out, or have it only seen (contype="0" conaffinity="0")'
        )
    own = next(body for body in bodies if body.name == name)
    at(key, lambda: refuse_property_maps(bodies))
    try:
        return ElasticSolid(own, **given)
    except AsperityError as error:
        message = str(error)
        joint = "." if message.partition(" ")[0].strip(":") in signature(_keys).parameters else ": "
        raise AsperityError(f"{key}{joint}{message}") from None
