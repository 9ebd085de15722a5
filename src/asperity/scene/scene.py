"""A scene: bodies, their textures, the force law, the coupling, and the tool's default motion.

On disk a scene is a folder of two files. `scene.xml` is MJCF, readable by any MuJoCo program:
bodies of primitive geoms, or of the convex pieces of a mesh; the tool is a body with a freejoint.
`scene.toml` adds what MJCF cannot express:

    schema = 1

    [tool]
    body = "probe"               # [tool.skin] or [bodies.NAME.skin]: an elastic layer on it;
                                 # [bodies.NAME.elastic]: it is elastic as a whole

    [bodies.part.mesh]           # the surface of a body whose geoms are of type mesh
    file = "part.stl"
    unit = "mm"

    [bodies.plate.texture]
    kind = "sinusoid"            # or: file = "coin.png", pixel_size = 1e-5, height_range = 1e-4
    wavelength = 2e-3            # all in SI units

    [force]
    stiffness = 400.0
    anti_alias = "tick"

    [coupling]
    mode = "direct"              # or implicit, semi-implicit, static

    [trajectory]
    kind = "slide"
    speed = 0.083
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco

from asperity._core.arrays import Array
from asperity._core.output import result_folder
from asperity._core.unpacking import stem_and_ending
from asperity.contact.deformable.elastic_solid import ElasticSolid
from asperity.contact.response.settings import ForceSettings
from asperity.contact.soft.skin import SoftSkin
from asperity.dynamics.virtual_coupling.settings import CouplingSettings
from asperity.errors import AsperityError
from asperity.geometry.bodies import Body, Geom
from asperity.geometry.mesh.materials import FELT
from asperity.scene.adapt import adapted
from asperity.scene.concave import with_convex_pieces
from asperity.scene.document import (
    SCHEMA,
    Table,
    at,
    beside,
    check_document,
    merged,
    read_toml,
    tables_with_files,
    write_toml,
)
from asperity.scene.elastic import ANTI_ALIAS_NOTE, scene_elastic
from asperity.scene.friction import settings_with, with_frictions
from asperity.scene.mesh import copy_with_companions, geoms_mesh, stretch_note
from asperity.scene.mjcf import (
    geom_names,
    read_mjcf,
    tool_start,
    touchable_geoms,
    warnings_as_notes,
)
from asperity.scene.property_maps import on_terrain, without_textures
from asperity.scene.regions import material_surface
from asperity.scene.sections import coupling_of, force_of, motion_of, unusual
from asperity.scene.skin import scene_skin
from asperity.scene.texture import body_surface
from asperity.scene.trajectory import ScriptedMotion, Trajectory

MODELS = (".xml", ".mjcf", ".urdf")
"""Kinds of files of a scene's bodies."""
PRESSED, PRESSED_IN = 0.6, 0.08
"""A finger's force [N], and the part of the relief that it may press a coupled tool in by."""
SOFTEST, STIFFEST = 3e4, 1e5
"""Least and largest stiffness of objects, if none is given [N/m]; project defaults."""
_BAND_NOTE = "force.anti_alias: on a coupling, band acts as tick"


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything that stays constant while the tool moves; created by `scene_of`.

    Parameters
    ----------
    name : str
    xml : str
        The MJCF.
    document : mapping
        Checked contents of `scene.toml`.
    folder : Path or None
        Folder of the files that `document` names.
    model : mujoco.MjModel
        Of `xml`, with concave meshes cut into convex pieces.
    bodies : tuple of Body
        All bodies, the tool included, in MuJoCo's order.
    tool : str
        Name of the body that is held.
    start : (7,) array
        Pose of the tool in `xml`.
    force : ForceSettings
    anti_alias : {"off", "tick", "band"}
        Treatment of texture that passes faster than the tick; see `simulation.anti_aliasing`.
    coupling : CouplingSettings
        Connection of the tool to the handle.
    motion : ScriptedMotion or Trajectory
        Default motion of the handle.
    notes : tuple of str
        Choices and changes made while meshes and textures were read.
    skin : SoftSkin or None
        Elastic layer on the tool, or on the one body that a rigid tool meets.
    elastic : ElasticSolid or None
        The one body that a rigid tool meets, if it is linear-elastic.
    """

    name: str
    xml: str
    document: Table
    folder: Path | None
    model: mujoco.MjModel
    bodies: tuple[Body, ...]
    tool: str
    start: Array
    force: ForceSettings
    anti_alias: str
    coupling: CouplingSettings
    motion: ScriptedMotion | Trajectory
    notes: tuple[str, ...]
    skin: SoftSkin | None = None
    elastic: ElasticSolid | None = None

    @property
    def soft(self) -> SoftSkin | ElasticSolid | None:
        """What is soft in the scene: `skin` or `elastic`."""
        return self.skin or self.elastic

    @property
    def shortest_wavelength(self) -> float:
        """Shortest wavelength in any texture [m]; infinite without texture.

        The taxels of an elastic body average waves shorter than their pitch.
        """
        lengths = [field.shortest_wavelength for body in self.bodies for field in body.fields]
        least = min(lengths, default=float("inf"))
        return least if self.elastic is None else max(least, self.elastic.pitch or 0.0)

    @property
    def acting_force(self) -> ForceSettings:
        """Settings of the contact with this coupling: on one, k is that of the objects.

        Without `object_stiffness` that is `stiffness`, or as much as it takes for `PRESSED` to go
        into no contact deeper than `PRESSED_IN` of its relief, but at most `STIFFEST`.
        """
        force = self.force
        if self.coupling.mode == "direct":
            return force
        stiffness = force.object_stiffness
        if stiffness is None:
            reliefs = {b.name: [field.relief for field in b.fields] or [0.0] for b in self.bodies}
            on_tool = reliefs.pop(self.tool)
            pairs = [one + two for ones in reliefs.values() for one in ones for two in on_tool]
            least = min((relief for relief in pairs if relief > 0.0), default=math.inf)
            wanted = PRESSED / (PRESSED_IN * least)
            stiffness = max(force.stiffness, SOFTEST, min(wanted, STIFFEST))
        return replace(force, stiffness=stiffness, object_stiffness=stiffness)

    @property
    def acting_anti_alias(self) -> str:
        """Treatment of fast texture with this coupling: on one, `tick` in the place of `band`.

        The delay of `band`, two and a half ticks, would make a stiff contact unstable, and a tool
        on its coupling passes little above half the tick rate.
        """
        if self.anti_alias == "band" and self.coupling.mode != "direct":
            return "tick"
        return self.anti_alias

    @property
    def files(self) -> dict[str, Path]:
        """Paths of the files that the document names, by those names."""
        names = [table["file"] for table in tables_with_files(self.document)]
        return {name: beside(self.folder, name) for name in names}

    def changed(self, **sections: Table) -> Scene:
        """Return the scene with some keys of its document changed; all is checked again.

        >>> scene.changed(force={"stiffness": 800.0}, trajectory={"speed": 0.169})
        """
        document = {key: value for key, value in self.document.items()}
        for section, table in sections.items():
            document[section] = merged(document.get(section, {}), table)
        return scene_of(self.xml, document, name=self.name, folder=self.folder)

    def smooth(self) -> Scene:
        """Return the scene without textures."""
        document = without_textures(self.document, self.bodies, self.model)
        return scene_of(self.xml, document, name=self.name, folder=self.folder)

    def save(self, folder: str | Path, *, overwrite: bool = False) -> None:
        """Write `scene.xml`, `scene.toml` and the files that it names into a folder."""
        document = merged(self.document, {})
        with result_folder(Path(folder), overwrite=overwrite) as fresh:
            for table in tables_with_files(document):
                source = beside(self.folder, table["file"])
                table["file"] = _free_name(fresh, source)
                copy_with_companions(source, fresh / table["file"])
            (fresh / "scene.xml").write_text(self.xml, "utf-8")
            (fresh / "scene.toml").write_text(write_toml(document), "utf-8")


def read_scene(path: str | Path) -> Scene:
    """Return the scene in a folder.

    Also takes a file in it: `scene.xml`, `scene.toml`, or another MJCF or URDF file. Without
    `scene.toml` the tool is the only body with a freejoint, and all else is as by default.
    """
    model, toml = _scene_files(Path(path))
    with warnings_as_notes([]):  # those that stay come again as the scene is made
        xml, notes = read_mjcf(model)
    folder = model.parent
    name = folder.resolve().name if model.name == "scene.xml" else model.stem
    if toml is not None:
        document = read_toml(toml)
    else:
        with warnings_as_notes([]):
            tool = at(str(model), lambda: adapted(xml)).tool
        document = {"schema": SCHEMA, "tool": {"body": tool}}
        notes = (
            *notes,
            f"there is no scene.toml: the tool is {tool!r}, its texture, force and motion are as "
            "by default; save the scene (--save DIR, Scene.save) to set them",
        )
    scene = at(str(folder), lambda: scene_of(xml, document, name=name, folder=folder))
    return replace(scene, notes=(*notes, *scene.notes))


def _scene_files(path: Path) -> tuple[Path, Path | None]:
    """Return the MJCF or URDF file of a scene, and its `scene.toml`, None without."""
    if path.is_file() and path.name != "scene.toml":
        if path.suffix.lower() not in MODELS:
            raise AsperityError(
                f"{path}: unknown kind of file; valid: a folder, or {', '.join(MODELS)}"
                "; give meshes by --tool and --target, or to make_scene"
            )
        toml = path.with_suffix(".toml")
        return path, toml if toml.is_file() else None
    folder = path.parent if path.name in ("scene.xml", "scene.toml") else path
    if not folder.is_dir():
        raise AsperityError(f"no such folder of a scene: {folder}")
    toml, model = folder / "scene.toml", folder / "scene.xml"
    if not model.is_file():
        # A scene.toml stands for a scene.xml.
        found = [p for p in sorted(folder.iterdir()) if p.suffix.lower() in MODELS]
        if toml.is_file() or len(found) != 1:
            several = f", and there are {', '.join(p.name for p in found[:8])}" if found else ""
            raise AsperityError(
                f"no such file: {model}; a scene is a folder of scene.xml and scene.toml{several}"
            )
        model = found[0]
    return model, toml if toml.is_file() else None


def scene_of(
    xml: str, document: Table, *, name: str = "scene", folder: Path | None = None
) -> Scene:
    """Return the scene of an MJCF text and a document.

    Parameters
    ----------
    xml : str
        MJCF that refers to no files.
    document : mapping
        Contents of `scene.toml`.
    name : str
    folder : Path, optional
        Folder of the files that `document` names.

    Raises
    ------
    AsperityError
        A key is wrong; the message names it and what would be valid. Or a geom is a concave mesh,
        and CoACD, which cuts it, is not installed.
    """
    held = document.get("tool", {})
    warned: list[str] = []
    with warnings_as_notes(warned):
        prepared = adapted(xml, held.get("body") if isinstance(held, Mapping) else None)
        model = prepared.model
        owned = touchable_geoms(model)
        check_document(document, owned)
        tool = document["tool"]["body"]
        start = tool_start(model, tool)
        cut, cut_notes = with_convex_pieces(xml, model, prepared.spec)
    solids = touchable_geoms(cut)
    force, anti_alias = force_of(document.get("force", {}))
    force, frictions = settings_with(
        force, prepared.frictions, document.get("force", {}), prepared.notes
    )
    bodies = []
    for body, geoms in owned.items():
        table = document.get("bodies", {}).get(body, {})
        made = _body(model, body, geoms, [geom for _, geom in solids[body]], table, folder)
        values = [frictions[number] for number, _ in geoms if number in frictions]
        bodies.append(with_frictions(made, values, prepared.notes) if values else made)
        if body in prepared.textures and "texture" not in table:
            field, middle = prepared.textures[body]
            bodies[-1] = on_terrain(bodies[-1], field, middle, table, f"bodies.{body}")
    coupling = coupling_of(document.get("coupling", {}))
    elastic = scene_elastic(document, tool, bodies)
    own_notes = [f"{body.name}: {note}" for body in bodies for note in _notes(body)]
    if elastic is not None:
        own_notes += [f"{elastic.body.name}: {note}" for note in elastic.notes]
        if anti_alias != "off":
            anti_alias = "off"
            own_notes.append(ANTI_ALIAS_NOTE)
    return Scene(
        name=name,
        xml=xml,
        document=merged(document, {}),
        folder=folder,
        model=cut,
        bodies=tuple(bodies),
        tool=tool,
        start=start,
        force=force,
        anti_alias=anti_alias,
        coupling=coupling,
        motion=motion_of(document.get("trajectory", {}), folder),
        notes=(
            *warned,
            *prepared.notes,
            *unusual(document),
            *cut_notes,
            *own_notes,
            *([_BAND_NOTE] if anti_alias == "band" and coupling.mode != "direct" else []),
        ),
        skin=scene_skin(document, tool, bodies),
        elastic=elastic,
    )


def _body(
    model: mujoco.MjModel, name: str, geoms: list[tuple[int, Geom]], solids: list[Geom],
    table: Table, folder: Path | None,
) -> Body:  # fmt: skip
    """Return one body of the model, with the mesh and texture of its table.

    `solids` are its geoms once concave meshes are cut.
    """
    key = f"bodies.{name}"
    mesh = geoms_mesh(model, name, geoms, table.get("mesh", {}), f"{key}.mesh", folder)
    own = body_surface(table, key, folder)
    if table.get("materials"):
        mesh, own = material_surface(mesh, table["materials"], f"{key}.materials", folder, own)
    names = geom_names(model, geoms)
    for geom, surface in table.get("geoms", {}).items():
        if mesh is not None or geom not in names:
            have = "none, since it is a mesh" if mesh is not None else ", ".join(names)
            raise AsperityError(f"{key}.geoms names {geom!r}; geoms of {name!r}: {have}")
        row = names.index(geom)
        found = body_surface(surface, f"{key}.geoms.{geom}", folder)
        solids = [*solids[:row], replace(solids[row], surface=found), *solids[row + 1 :]]
    where = key if own.texture is None else f"{key}.texture"
    return at(where, lambda: Body(name, solids, mesh=mesh, **vars(own)))


def _notes(body: Body) -> tuple[str, ...]:
    """Return the notes of a body's mesh and texture."""
    notes = body.mesh.notes if body.mesh is not None else ()
    if body.texture is None and body.mesh is not None:
        notes += tuple(
            f"material {material.name!r} names a {kind} map that is not used: "
            f"{material.maps[kind].name}; give it as [bodies.{body.name}.texture]"
            for material in body.mesh.materials
            for kind in FELT
            if kind in material.maps
        )
    notes += stretch_note(body.mesh, body.texture, body.mapping)
    for found in (*body.fields, *body.friction_maps, *body.stiffness_maps):
        notes += tuple(found.notes)
    return notes


def _free_name(folder: Path, source: Path) -> str:
    (stem, ending), name, count = stem_and_ending(source), source.name, 1
    while (folder / name).exists():
        name, count = f"{stem}-{count}{ending}", count + 1
    return name
