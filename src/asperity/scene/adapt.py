"""A user's MJCF, made such that a textured scene can be built of it.

Bodies without a name get one, rigid bodies on the tool become part of it, and a height field
becomes a plate with a texture. The file itself stays as it is: this is done to the model each time
a scene is made of it. What MJCF states of contact and is not used is noted.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np

from asperity._core.arrays import Array
from asperity.errors import AsperityError
from asperity.geometry.mesh.checks import length
from asperity.geometry.poses import rotation_of
from asperity.scene.friction import frictions
from asperity.scene.mjcf import compiled, is_touchable, mujoco_s_words
from asperity.texture.height_field import HeightField

_FEWEST = 4
"""Heights along a side of a texture."""
_THICK = 4.0
"""Least thickness of the plate under a height field, in its relief."""
_COPIED = (
    "contype", "conaffinity", "condim", "priority", "friction", "solmix", "solref", "solimp",
    "margin", "gap", "rgba", "material", "group",
)  # fmt: skip
_NOT_READ = {
    "margin": "contact begins where surfaces touch", "gap": "contact begins where surfaces touch",
    "solref": "stiffness and damping are those of [force]",
    "solimp": "stiffness and damping are those of [force]",
}  # fmt: skip
"""Attributes of contact that are not used, and what holds instead."""
_UNUSED_ELEMENTS = {
    "equality": "constraints", "tendon": "tendons", "actuator": "actuators",
    "pair": "contact pairs", "deformable": "deformable bodies",
}  # fmt: skip
_ACROSS = 1e-4, 2.0
"""Smallest and largest tool whose size is not doubted [m]."""
_NO_CONSTRAINT = mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
_IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


@dataclass
class Adapted:
    """A model of which a scene can be made.

    Attributes
    ----------
    model : mujoco.MjModel
    spec : mujoco.MjSpec or None
        Of the model, if anything was changed.
    textures : dict of str to (HeightField, (2,) array)
        Height fields by body, and where on it their middles are [m].
    frictions : dict of int to float
        Coefficients of the geoms of `model`, if the file states any: in a pair the larger counts.
    tool : str
        Name of the body that is held.
    notes : list of str
    """

    model: mujoco.MjModel
    spec: Any = None
    textures: dict[str, tuple[HeightField, Array]] = field(default_factory=dict)
    frictions: dict[int, float] = field(default_factory=dict)
    tool: str = ""
    notes: list[str] = field(default_factory=list)


def adapted(xml: str, tool: object = None) -> Adapted:
    """Return the model of MJCF text, made such that a scene can be built of it.

    Parameters
    ----------
    xml : str
        MJCF that refers to no files.
    tool : str, optional
        Name of the body that is held; one that the file lacks is no error here. By default the
        only body with a freejoint, else the only mocap body.
    """
    model, spec = compiled(xml), None
    notes: list[str] = []
    mocap = _mocap_tool(model, tool)
    if mocap:
        spec = mujoco.MjSpec.from_string(xml)
        spec.compile()  # numbers its bodies
        moved = next(body for body in spec.bodies if body.id == mocap)
        moved.mocap = False
        moved.add_freejoint()
        model = _made(spec)
        notes.append("the tool is a mocap body: it is held as one with a freejoint")
    touched = [i for i in range(model.ngeom) if is_touchable(model, i)]
    names = _names(model, touched)
    if tool is None:
        tool = names.get(free := _only_free(model), model.body(free).name)
    known = [names.get(i, model.body(i).name) for i in range(model.nbody)]
    tool_id = known.index(tool) if tool in known else -1
    fields = [i for i in touched if model.geom_type[i] == mujoco.mjtGeom.mjGEOM_HFIELD]
    # Only what hangs on a body with a joint moves with it.
    moves = tool_id > 0 and model.body_weldid[tool_id] == tool_id
    on_tool = [i for i in touched if moves and _is_fixed_to(model, i, tool_id)]
    for i in on_tool:  # their bodies need none
        names.pop(int(model.geom_bodyid[i]), None)
    out = Adapted(model, spec, tool=str(tool), notes=notes)
    if names or fields or on_tool:
        spec = out.spec = spec or mujoco.MjSpec.from_string(xml)
        spec.compile()  # numbers its geoms and bodies, until one is added
        spec.compiler.discardvisual = False
        bodies = {body.id: body for body in spec.bodies}
        geoms = {geom.id: geom for geom in spec.geoms}
        for i, name in names.items():
            bodies[i].name = name
            out.notes.append(f"a body without a name is called {name!r}")
        if on_tool:
            _merge(model, bodies, geoms, on_tool, tool_id, out)
        for number in fields:
            _plate(model, bodies, geoms[number], touched, out)
        out.model = _made(spec)
    _read_contact(xml, out)
    return out


def _made(spec: Any) -> mujoco.MjModel:
    """Return the model of a changed spec."""
    try:
        return spec.compile()
    except ValueError as error:
        raise AsperityError(f"scene.xml cannot be adapted: {mujoco_s_words(error)}") from None


def _mocap_tool(model: mujoco.MjModel, tool: object) -> int:
    """Return the number of the tool if it is a mocap body, 0 otherwise.

    Without a name the only mocap body is the tool, unless a body has a freejoint.
    """
    mocap = [i for i in range(model.nbody) if model.body_mocapid[i] >= 0]
    if tool is not None:
        return next((i for i in mocap if model.body(i).name == tool), 0)
    free = (model.jnt_type == mujoco.mjtJoint.mjJNT_FREE).any()
    return mocap[0] if len(mocap) == 1 and not free else 0


def _is_fixed_to(model: mujoco.MjModel, geom: int, body: int) -> bool:
    """Return whether a geom belongs to another body that is fixed to a body."""
    owner = int(model.geom_bodyid[geom])
    return owner != body and model.body_weldid[owner] == model.body_weldid[body]


def _names(model: mujoco.MjModel, touched: list[int]) -> dict[int, str]:
    """Return names for bodies without one that are free or have geoms that can be touched."""
    taken = {model.body(i).name for i in range(model.nbody)}
    wanted: dict[int, str] = {}
    for i in touched:
        data, mesh = int(model.geom_dataid[i]), model.geom_type[i] == mujoco.mjtGeom.mjGEOM_MESH
        of_mesh = model.mesh(data).name if mesh and data >= 0 else ""
        wanted.setdefault(int(model.geom_bodyid[i]), model.geom(i).name or of_mesh)
    free = model.jnt_bodyid[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE]
    wanted |= {int(i): wanted.get(int(i), "") for i in free}
    return {
        i: _free(name or f"body-{i}", taken)
        for i, name in sorted(wanted.items())
        if not model.body(i).name
    }


def _only_free(model: mujoco.MjModel) -> int:
    """Return the only body with a freejoint."""
    free = model.jnt_bodyid[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE]
    if len(free) != 1:
        names = ", ".join(repr(model.body(int(i)).name) for i in free[:8]) or "none"
        raise AsperityError(
            f"bodies with a freejoint: {names}; valid: one, which is the tool, or a scene.toml "
            "with [tool] body = NAME. A model that moves by its own joints is for asperity.mujoco, "
            "and for asperity view MODEL --simulate"
        )
    return int(free[0])


def _free(wanted: str, taken: set[str]) -> str:
    name, count = wanted, 1
    while name in taken:
        count += 1
        name = f"{wanted}-{count}"
    taken.add(name)
    return name


def _pose(model: mujoco.MjModel, body: int, above: int) -> tuple[Array, Array]:
    """Return the position (3,) and quaternion (4,) of a body in one that it is fixed to."""
    position, quaternion = np.zeros(3), _IDENTITY.copy()
    while body != above:
        position, quaternion = _composed(
            model.body_pos[body], model.body_quat[body], position, quaternion
        )
        body = int(model.body_parentid[body])
    return position, quaternion


def _composed(
    position: Array, quaternion: Array, inner_position: Array, inner_quaternion: Array
) -> tuple[Array, Array]:
    """Return the place of a frame that lies in another one."""
    turned = np.empty(4)
    mujoco.mju_mulQuat(turned, quaternion, inner_quaternion)
    return position + rotation_of(quaternion) @ inner_position, turned


def _merge(
    model: mujoco.MjModel, bodies: dict[int, Any], geoms: dict[int, Any], on_tool: list[int],
    tool: int, out: Adapted,
) -> None:  # fmt: skip
    """Make geoms of bodies that are fixed to the tool its own; their mass goes with them."""
    parts = {int(model.geom_bodyid[i]) for i in on_tool}
    for i in on_tool:
        source = geoms[i]
        kind = mujoco.mjtGeom(int(model.geom_type[i]))
        place = model.geom_pos[i].copy(), model.geom_quat[i].copy()
        if kind == mujoco.mjtGeom.mjGEOM_HFIELD:
            raise AsperityError(
                "a height field is fixed to the tool; valid: on another body, or a texture of it"
            )
        if kind == mujoco.mjtGeom.mjGEOM_MESH:
            place = _unmoved(model, int(model.geom_dataid[i]), *place)
        inner = _pose(model, int(model.geom_bodyid[i]), tool)
        position, quaternion = _composed(*inner, *place)
        added = bodies[tool].add_geom(
            name=f"{source.name or f'geom-{i}'} on the tool", type=kind, size=model.geom_size[i],
            pos=position, quat=quaternion, mass=0.0, meshname=source.meshname,
        )  # fmt: skip
        for key in _COPIED:
            setattr(added, key, getattr(source, key))
        source.contype = source.conaffinity = 0
    _weigh(model, bodies, tool)
    names = ", ".join(
        repr(bodies[i].name) if bodies[i].name else "one without a name" for i in parts
    )
    out.notes.append(f"{names}: fixed to the tool {bodies[tool].name!r} and part of it")


def _unmoved(
    model: mujoco.MjModel, mesh: int, position: Array, quaternion: Array
) -> tuple[Array, Array]:
    """Return the place of a mesh's own frame, which MuJoCo has moved to its middle."""
    back = np.empty(4)
    mujoco.mju_negQuat(back, model.mesh_quat[mesh])
    turned = np.empty(4)
    mujoco.mju_mulQuat(turned, quaternion, back)
    return position - rotation_of(turned) @ model.mesh_pos[mesh], turned


def _weigh(model: mujoco.MjModel, bodies: dict[int, Any], tool: int) -> None:
    """Give the tool the mass and inertia of all that is fixed to it, and the others none."""
    fixed = [i for i in range(model.nbody) if model.body_weldid[i] == model.body_weldid[tool]]
    masses = model.body_mass[fixed]
    total = float(masses.sum())
    if total <= 0.0:
        return
    places = [
        _composed(*_pose(model, i, tool), model.body_ipos[i], model.body_iquat[i]) for i in fixed
    ]
    centre = np.einsum("i,ij->j", masses, [position for position, _ in places]) / total
    inertia = np.zeros((3, 3))
    for i, mass, (position, quaternion) in zip(fixed, masses, places, strict=True):
        turn, away = rotation_of(quaternion), position - centre
        inertia += turn @ np.diag(model.body_inertia[i]) @ turn.T
        inertia += mass * (away @ away * np.eye(3) - np.outer(away, away))
    body = bodies[tool]
    body.explicitinertial, body.mass, body.ipos, body.iquat = True, total, centre, _IDENTITY
    body.fullinertia = [*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]]
    for i in fixed:
        if i != tool:
            bodies[i].explicitinertial = False
            for geom in bodies[i].geoms:
                geom.mass = 0.0


def _plate(
    model: mujoco.MjModel, bodies: dict[int, Any], geom: Any, touched: list[int], out: Adapted
) -> None:
    """Put a plate with a texture in the place of a height field."""
    number, body = geom.id, bodies[int(model.geom_bodyid[geom.id])]
    hfield = int(model.geom_dataid[number])
    columns, rows = int(model.hfield_ncol[hfield]), int(model.hfield_nrow[hfield])
    half_x, half_y, relief, base = model.hfield_size[hfield]
    start = int(model.hfield_adr[hfield])
    heights = np.asarray(model.hfield_data[start : start + rows * columns], dtype=np.float64)
    heights = _refined(_refined(relief * heights.reshape(rows, columns)).T).T
    pixel = tuple(
        2.0 * half / (n - 1) for half, n in zip((half_x, half_y), heights.shape[::-1], strict=True)
    )
    name = f"height field {geom.hfieldname!r}"
    position, quaternion = model.geom_pos[number].copy(), model.geom_quat[number].copy()
    alone = sum(model.geom_bodyid[i] == model.geom_bodyid[number] for i in touched) == 1
    if not (alone and np.allclose(quaternion, _IDENTITY)):
        if body.name and model.body_dofnum[int(model.geom_bodyid[number])]:
            raise AsperityError(
                f"{name} moves with other geoms of body {body.name!r}; valid: a body that stands"
            )
        taken = {other.name for other in out.spec.bodies}
        owner = _free(geom.hfieldname, taken)
        body = body.add_body(name=owner, pos=position, quat=quaternion)
        position, quaternion = np.zeros(3), _IDENTITY
        out.notes.append(f"{name} is a separate body, {owner!r}")
    # A texture reaches at most half as far as the plate is thick.
    half = max(0.5 * base, 0.5 * _THICK * float(np.ptp(heights)), 1e-4)
    box = body.add_geom(
        name=f"{geom.name or geom.hfieldname} plate", type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[half_x, half_y, half], pos=position - [0.0, 0.0, half], quat=quaternion, mass=0.0,
    )  # fmt: skip
    for key in _COPIED:
        setattr(box, key, getattr(geom, key))
    geom.contype = geom.conaffinity = 0
    note = (
        f"{name} is a plate of {length(2 * half_x)} x {length(2 * half_y)} whose texture has its "
        f"{columns} x {rows} heights, {length(float(np.ptp(heights)))} of relief, as a smooth "
        "surface; its sides are displaced too"
    )
    try:
        texture = HeightField(heights, pixel, "clamp")
    except AsperityError as error:
        raise AsperityError(f"{name} is no texture: {error}; `asperity bake` makes one") from None
    out.notes.append(note)
    out.textures[body.name] = texture, position[:2]


def _refined(values: Array) -> Array:
    """Return rows of values between which there are more, until there are four at least."""
    while len(values) < _FEWEST:
        middle = 0.5 * (values[:-1] + values[1:])
        out = np.empty((2 * len(values) - 1, *values.shape[1:]))
        out[::2], out[1::2] = values, middle
        values = out
    return values


def _read_contact(xml: str, out: Adapted) -> None:
    """Read what the file states of friction, and note what it states and is not used."""
    stated, model = _stated(xml), out.model
    for key, instead in _NOT_READ.items():
        if key in stated:
            out.notes.append(f"{key} of geoms is not used: {instead}")
    left_out = [words for name, words in _UNUSED_ELEMENTS.items() if name in stated["elements"]]
    if left_out:
        out.notes.append(f"not used of scene.xml: {', '.join(left_out)}")
    if model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_OVERRIDE:
        out.notes.append("not used of scene.xml: the contact that option overrides (o_friction)")
    bodies = {model.body(i).name: i for i in range(1, model.nbody)}
    if out.tool not in bodies:
        return
    _doubt(model, bodies[out.tool], out)
    if model.opt.disableflags & (mujoco.mjtDisableBit.mjDSBL_CONTACT | _NO_CONSTRAINT):
        out.notes.append(f"by the flags of option {out.tool!r} touches nothing")
    pairs = [divmod(int(pair), 1 << 16) for pair in model.exclude_signature]
    apart = [b for pair in pairs if bodies[out.tool] in pair for b in pair]
    names = [model.body(b).name for b in dict.fromkeys(apart) if b != bodies[out.tool]]
    if names:
        out.notes.append(f"{out.tool!r} does not touch {', '.join(names)}, as <exclude> states")
    if "friction" not in stated:
        return
    out.frictions = frictions(model, bodies[out.tool], out.notes)


def _doubt(model: mujoco.MjModel, tool: int, out: Adapted) -> None:
    """Note a tool that is hardly in metres, or that touches nothing."""
    touched = [i for i in range(model.ngeom) if is_touchable(model, i)]
    mine = [i for i in touched if model.geom_bodyid[i] == tool]
    if not mine:
        return
    across = 2.0 * float(model.geom_rbound[mine].max())  # of a plane 0
    if across and not _ACROSS[0] <= across <= _ACROSS[1]:
        out.notes.append(
            f"is {out.tool!r} in m? It is {across:.4g} m across; usual: {_ACROSS[0]:g} to "
            f"{_ACROSS[1]:g}; lengths in scene.xml are in m"
        )
    kinds, partners = model.geom_contype, model.geom_conaffinity
    others = [i for i in touched if i not in mine]
    if not any(kinds[i] & partners[j] or partners[i] & kinds[j] for i in mine for j in others):
        why = "by contype and conaffinity" if others else "all other geoms are only seen:"
        out.notes.append(f"{why} {out.tool!r} touches nothing")


def _stated(xml: str) -> dict[str, Any]:
    """Return attributes of geoms, also by default classes, that a file states, and its elements."""
    try:
        root = ElementTree.fromstring(xml)
    except ElementTree.ParseError:  # MuJoCo reads more than is XML
        return {"elements": set()}
    found: dict[str, Any] = {"elements": set()}
    for element in root.iter():
        if element.tag in _UNUSED_ELEMENTS and (len(element) or element.attrib):
            found["elements"].add(element.tag)
        if element.tag == "geom":
            found |= dict.fromkeys(element.attrib, True)
    return found
