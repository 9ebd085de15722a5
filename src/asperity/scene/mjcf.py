"""A scene's MJCF: read, judged, and written where bodies are meshes.

MuJoCo collides a mesh as its convex hull. So a body with a mesh has convex pieces, geoms of type
mesh in group 3, which viewers hide; and one geom in group 2 with the whole mesh, which is only
seen, so that any tool of MuJoCo shows the real shape. All meshes are in the XML itself.

The XML is written from templates. `MjSpec.to_xml` would round vertices to six digits, which moves
those of hammer-blocks by up to 67 nm, and would replace `fromto` by quaternions.
"""

from __future__ import annotations

import re
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array, Indices
from asperity._core.files import text_of
from asperity.errors import AsperityError
from asperity.geometry.bodies import KINDS, Geom
from asperity.geometry.mesh.mesh import Mesh
from asperity.geometry.mesh.topology import edges_of
from asperity.geometry.poses import require_pose

GEOMS = {getattr(mujoco.mjtGeom, f"mjGEOM_{kind.upper()}"): kind for kind in KINDS}
MOST_SEEN = 50_000
"""A mesh of more triangles is not written into the XML to be seen."""
_FILES = re.compile(r"<robot\b|\bfile\w*\s*=")
"""What is read through MuJoCo's own reader: URDF, and MJCF that names files."""
_XACRO = re.compile(r"<xacro:|\$\{|\$\(find ")
_PACKAGE = re.compile(r"(?:package|model)://([^/\"']+)/([^\"']+)")
"""A file of a package of ROS, or of a model of Gazebo."""
_FILE_URI = re.compile(r"file://(?:localhost)?(?=/)")
TRIPLES_A_LINE = 8
"""Triples of numbers in a line of the XML."""
MODEL = """<mujoco model="{name}">
  <!-- Metres and kilograms. {note} -->
  <compiler angle="radian"{compiler}/>
  <visual>
    <map znear="0.001"/>
  </visual>
  <statistic extent="{extent:.6g}" center="{centre}"/>
  <asset>
{assets}
  </asset>
  <worldbody>
    <light pos="{light}" dir="-0.2 0.5 -0.8"/>
{bodies}
  </worldbody>
</mujoco>
"""
"""Template of a scene: `compiler` are more attributes, `assets` and `bodies` elements."""


def model_around(
    name: str, box: tuple[Array, Array], *, note: str, assets: str, bodies: str, compiler: str = ""
) -> str:
    """Return the MJCF of `MODEL`, with its light and view placed by the box (low, high) [m]."""
    low, high = box
    extent = float(np.linalg.norm(high - low))
    middle = 0.5 * (low + high)
    light = middle + extent * np.array([0.3, -0.6, 1.2])
    return MODEL.format(
        name=name.replace("&", "and").replace('"', "").replace("<", ""),
        note=note,
        compiler=compiler,
        extent=extent,
        centre=" ".join(f"{value:.9g}" for value in middle),
        light=" ".join(f"{value:.9g}" for value in light),
        assets=assets,
        bodies=bodies,
    )


class _Listeners(threading.local):
    """The notes of each thread that MuJoCo's warnings are added to, the innermost last."""

    def __init__(self) -> None:
        self.notes: list[list[str]] = []


_listeners, _lock = _Listeners(), threading.Lock()
_usual: list[Any] = []
"""What MuJoCo called before, for each that listens."""


def _keep(text: str) -> None:
    """Add a warning of MuJoCo's to the notes of the thread that it comes from."""
    if _listeners.notes:
        note, notes = f"MuJoCo: {' '.join(text.split())[:160]}", _listeners.notes[-1]
        notes.extend([] if note in notes else [note])
    else:
        print(f"WARNING: {text}", file=sys.stderr)


@contextmanager
def warnings_as_notes(notes: list[str]) -> Iterator[None]:
    """Add MuJoCo's warnings, which it would print, to notes, each once.

    MuJoCo has one function for the warnings of all threads: it is set back when the last thread
    has left.
    """
    with _lock:
        _usual.append(mujoco.get_mju_user_warning())
        mujoco.set_mju_user_warning(_keep)
    _listeners.notes.append(notes)
    try:
        yield
    finally:
        _listeners.notes.pop()
        with _lock:
            # The first of those within found the function that was there before all of them.
            mujoco.set_mju_user_warning(_keep if len(_usual) > 1 else _usual[0])
            _usual.pop()


def compiled(xml: str) -> mujoco.MjModel:
    """Return the model of MJCF text, or say in one line what is wrong with it."""
    try:
        return mujoco.MjModel.from_xml_string(xml)
    except ValueError as error:
        raise AsperityError(_refusal("scene.xml", error)) from None


def read_mjcf(path: Path) -> tuple[str, tuple[str, ...]]:
    """Return MJCF as one text without files, and notes on what was left out.

    What is included, and meshes in files, are written into the text. Pictures on materials are
    left out.
    """
    try:
        xml = text_of(path.read_bytes())
        if not xml.strip():
            raise AsperityError(f"{path}: the file is empty")
        if _XACRO.search(xml):
            raise AsperityError(
                f"{path} has macros of xacro; valid: the URDF that `xacro {path.name}` makes of it"
            )
        if not _FILES.search(xml):
            return xml, ()
        # Through MuJoCo's own reader, so that files are found beside this one.
        here = _without_packages(xml, path.resolve())
        if here == xml:
            spec = mujoco.MjSpec.from_file(str(path))
        else:
            spec = mujoco.MjSpec.from_string(here)
            spec.modelfiledir = str(path.parent)
        notes = _without_pictures(spec)  # first, so that none has to be there
        model = spec.compile()
        for mesh in spec.meshes:
            if mesh.file:
                _write_in(mesh, model)
        for hfield in spec.hfields:
            if hfield.file:
                hfield.nrow = int(model.hfield_nrow[hfield.id])
                hfield.ncol = int(model.hfield_ncol[hfield.id])
                start = model.hfield_adr[hfield.id]
                hfield.userdata = model.hfield_data[start:][: hfield.nrow * hfield.ncol].tolist()
                hfield.file = ""
        return spec.to_xml(), notes
    except AsperityError:
        raise
    except (ValueError, OSError) as error:
        raise AsperityError(_refusal(path, error)) from None


def _without_packages(xml: str, path: Path) -> str:
    """Return the text of a URDF whose `package://` and `file://` are paths, where they are there.

    A package is a folder of its name, of this file or beside one of its; or it is this file's,
    whatever its folder is called.
    """

    def found(match: re.Match[str]) -> str:
        package, rest = match.groups()
        places = [place for above in path.parents for place in (above / package, above)]
        own = next((place / rest for place in places if (place / rest).is_file()), None)
        return match.group() if own is None else own.as_posix()

    return _PACKAGE.sub(found, _FILE_URI.sub("", xml))


def _write_in(mesh: Any, model: mujoco.MjModel) -> None:
    """Replace the file of a spec's mesh by its vertices and faces, scaled and placed."""
    vertices, faces = model_mesh(model, mesh.id)
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, model.mesh_quat[mesh.id])
    vertices = vertices @ turn.reshape(3, 3).T + model.mesh_pos[mesh.id]
    mesh.name = mesh.name or Path(mesh.file).stem
    mesh.file = ""
    mesh.scale, mesh.refpos, mesh.refquat = [1.0] * 3, [0.0] * 3, [1.0, 0.0, 0.0, 0.0]
    mesh.uservert, mesh.userface = vertices.ravel().tolist(), faces.ravel().tolist()


def _without_pictures(spec: Any) -> tuple[str, ...]:
    """Make every texture of a spec that is a file a plain one."""
    names = []
    for texture in spec.textures:
        files = [texture.file, *texture.cubefiles]
        if any(files):
            names.append(next(Path(file).name for file in files if file))
            texture.name = texture.name or Path(texture.file).stem
            texture.file, texture.cubefiles = "", [""] * 6
            texture.builtin, texture.width, texture.height = mujoco.mjtBuiltin.mjBUILTIN_FLAT, 1, 1
            if texture.type == mujoco.mjtTexture.mjTEXTURE_CUBE:
                texture.height = 6
    return (f"pictures on materials are left out: {', '.join(names)}",) if names else ()


def _refusal(path: object, error: Exception) -> str:
    """Return in one line why MuJoCo does not read a file."""
    reason = " ".join(str(error).split())
    lost = re.search(r"Error opening file '([^']*)'", reason)
    if lost:
        ros = "or from that of the package, " if lost.group(1).startswith("package:") else ""
        return (
            f"{path} names the file {lost.group(1)[-100:]!r}, which cannot be opened; valid: a "
            f"path from its folder, {ros}or from meshdir, texturedir or assetdir"
        )
    unknown = re.search(r"no decoder found for mesh file '([^']*)'", reason)
    if unknown:
        return (
            f"{path} names the mesh {Path(unknown.group(1)).name[-100:]!r}, of a kind that is not "
            "read; valid: .stl, .obj or .msh"
        )
    return f"{path} is not MJCF: {mujoco_s_words(error)}"


def mujoco_s_words(error: Exception) -> str:
    """Return in a part of a line what MuJoCo states, without the names of its exceptions."""
    reason = " ".join(str(error).split())
    damaged = re.search(
        r"Error=XML_ERROR_(\w+) .*?Line number=(\d+)(?:: XMLElement name=(\w+))?", reason
    )
    if damaged:
        kind, line, element = damaged.groups()
        where = f" at <{element}>" if element else ""
        return f"its XML is damaged in line {line}{where} ({kind.replace('_', ' ').lower()})"
    return re.sub(r"^(?:(?:XML )?Error: |Schema violation: )+", "", reason)[:200]


def model_mesh(model: mujoco.MjModel, number: int) -> tuple[Array, Indices]:
    """Return vertices (n, 3) and faces (m, 3) of a mesh as MuJoCo has it: about its middle."""
    first, count = model.mesh_vertadr[number], model.mesh_vertnum[number]
    vertices = np.asarray(model.mesh_vert[first : first + count], dtype=np.float64)
    first, count = model.mesh_faceadr[number], model.mesh_facenum[number]
    return vertices, np.asarray(model.mesh_face[first : first + count], dtype=np.int64)


def is_touchable(model: mujoco.MjModel, geom: int) -> bool:
    """Return whether a geom can be touched, and is not only seen."""
    return bool(model.geom_contype[geom] or model.geom_conaffinity[geom])


def touchable_geoms(model: mujoco.MjModel) -> dict[str, list[tuple[int, Geom]]]:
    """Return the geoms that can be touched, with their numbers, by the name of their body."""
    owned: dict[str, list[tuple[int, Geom]]] = {}
    for i in range(model.ngeom):
        if not is_touchable(model, i):
            continue
        body = model.body(int(model.geom_bodyid[i]))
        if not body.name:
            raise AsperityError(f"body {body.id} of scene.xml has geoms but no name; give it one")
        kind = GEOMS.get(mujoco.mjtGeom(int(model.geom_type[i])))
        if kind is None:
            raise AsperityError(
                f"body {body.name!r} has a geom of type "
                f"{mujoco.mjtGeom(int(model.geom_type[i])).name[7:].lower()}; "
                f"valid: {', '.join(GEOMS.values())}"
            )
        size = model.geom_size[i]
        if kind == "mesh":  # a box round its place
            size = np.abs(model.geom_aabb[i, :3]) + model.geom_aabb[i, 3:]
        geom = Geom(kind, size, model.geom_pos[i], model.geom_quat[i])
        owned.setdefault(body.name, []).append((i, geom))
    return owned


def geom_names(model: mujoco.MjModel, geoms: list[tuple[int, Geom]]) -> list[str]:
    """Return the names by which a document calls the geoms of a body: without one, its number."""
    return [model.geom(number).name or str(i) for i, (number, _) in enumerate(geoms)]


def tool_start(model: mujoco.MjModel, tool: str) -> Array:
    """Return the tool's pose in the file; refuse a tool that is not free, or others that are."""
    for i in range(model.njnt):
        body = model.body(int(model.jnt_bodyid[i])).name
        free = model.jnt_type[i] == mujoco.mjtJoint.mjJNT_FREE
        if body != tool:
            raise AsperityError(f"body {body!r} has a joint; only the tool ({tool!r}) may move")
        if not free:
            raise AsperityError(
                f"the tool {tool!r} has a joint that is no freejoint; valid: a freejoint alone, as "
                "the hand or the trajectory moves it"
            )
    if model.njnt == 0:
        raise AsperityError(
            f"the tool {tool!r} must have a freejoint, or be a mocap body; scene.xml has no joint"
        )
    return require_pose(model.qpos0[:7], f"pose of {tool!r}")


def mesh_assets(name: str, mesh: Mesh, pieces: Sequence[Array]) -> str:
    """Return the `<mesh>` elements of a body: its pieces, and the whole to be seen.

    Parameters
    ----------
    name : str
        Of the body; theirs begin with it.
    mesh : Mesh
    pieces : sequence of (n, 3) arrays
        Vertices of convex pieces [m], in the body's frame.
    """
    lines = [
        f'    <mesh name="{name}-{i}" vertex="{_numbers(piece, ".9g")}"/>'
        for i, piece in enumerate(pieces, start=1)
    ]
    if len(mesh.faces) <= MOST_SEEN:
        inertia = "exact" if is_closed(mesh) else "shell"
        lines.append(
            f'    <mesh name="{name}-shape" inertia="{inertia}" '
            f'vertex="{_numbers(mesh.vertices, ".9g")}"\n          '
            f'face="{_numbers(mesh.faces, "d")}"/>'
        )
    return "\n".join(lines)


def mesh_geoms(name: str, mesh: Mesh, *, density: Sequence[float], rgba: Sequence[str]) -> str:
    """Return the `<geom>` elements of a body whose assets `mesh_assets` wrote.

    Parameters
    ----------
    name : str
        Of the body.
    mesh : Mesh
    density : sequence of float
        Of each piece [kg/m^3]. If all are the same, and the mesh is closed and written, its mass is
        that of the whole mesh; else of the pieces.
    rgba : sequence of str
        Colour of each piece; the whole is seen in that of the first.
    """
    seen = len(mesh.faces) <= MOST_SEEN
    weighed = seen and len(set(density)) == 1 and is_closed(mesh)
    lines = []
    if seen:
        mass = f'density="{density[0]:.9g}"' if weighed else 'mass="0"'
        lines.append(
            f'      <geom name="{name}-shape" type="mesh" mesh="{name}-shape" group="2" '
            f'contype="0" conaffinity="0" {mass} rgba="{rgba[0]}"/>'
        )
    for i, (value, colour) in enumerate(zip(density, rgba, strict=True), start=1):
        mass = 'mass="0"' if weighed else f'density="{value:.9g}"'
        lines.append(
            f'      <geom name="{name}-{i}" type="mesh" mesh="{name}-{i}" '
            f'group="{3 if seen else 2}" {mass} rgba="{colour}"/>'
        )
    return "\n".join(lines)


def is_closed(mesh: Mesh) -> bool:
    """Return whether each side of each triangle is that of one other, run the other way."""
    # Corners in one place are one, whether or not they are one vertex.
    _, place = np.unique(mesh.vertices, axis=0, return_inverse=True)
    at = place.reshape(-1)[mesh.faces]
    edges, start = edges_of(at), at.ravel()
    other_way = start[edges.pairs[:, 0]] != start[edges.pairs[:, 1]]
    return bool((edges.size == 2).all() and other_way.all())


def _numbers(rows: NDArray[Any], form: str) -> str:
    """Return rows of three numbers, a few to a line."""
    texts = [" ".join(format(value, form) for value in row) for row in rows.tolist()]
    starts = range(0, len(texts), TRIPLES_A_LINE)
    lines = ["  ".join(texts[i:][:TRIPLES_A_LINE]) for i in starts]
    return "\n          ".join(lines)
