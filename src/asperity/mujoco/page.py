"""A browser page on a running MuJoCo model: displaced textures and contact forces."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity.drawing.renderer.parts import Part, geom_rgba
from asperity.errors import AsperityError, require_between
from asperity.geometry.bodies import Body, Geom
from asperity.geometry.displaced.view import ViewBall
from asperity.geometry.mesh.mesh import mesh_from_arrays
from asperity.geometry.mesh.normals import HARD_ANGLE
from asperity.mujoco.bodies import frame_of
from asperity.mujoco.flexes import flex_triangles
from asperity.mujoco.model_panel import ModelPanel
from asperity.mujoco.names import geom_name
from asperity.mujoco.surfaces import Surfaces, attach
from asperity.scene.mjcf import GEOMS, model_mesh
from asperity.viewer.drawables.colours import CONTACT
from asperity.viewer.drawables.shapes import FEWEST, MOST, Drawable, shapes_of_parts
from asperity.viewer.drawables.stage import UNITS, add_ground, add_shape, place, set_up_view
from asperity.viewer.server.pace import UPDATE_RATE
from asperity.viewer.server.server import LOCAL, start_server, stop_server

Array = NDArray[np.float64]
_HERE = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
_MOST_GROUP = 2
"""Geoms of higher groups are not shown, as in MuJoCo's own viewer."""
_LONGEST = 0.25
"""Length of the arrow of the largest recent force, over the size of the view."""
_FADING = 0.9
"""Decay factor per picture of the largest recent force."""
_FINE = 200_000
"""Default number of triangles: a model has more textured geoms than a scene."""
_WIDE = 10.0
"""Largest extent of a model in units of the view, within which viser draws shadows."""
_FIELD_OF_VIEW, _FROM = 35.0, np.array([0.7, -0.93, 0.58])
"""Field of view of browsers [degrees], and position of the camera over the size of the view."""
_BEHIND, _MOST_STEPS = 0.5, 20
"""Delay above which a model no longer catches up with real time [s], and most steps at once."""
_IDLE = 0.01
"""Wait of a paused model [s]."""


class ModelPage:
    """A page that shows one `MjData` of a model with textures, on this computer only.

    MuJoCo's own viewer may run beside it.

    Parameters
    ----------
    surfaces : Surfaces
    port : int
        0: any that is free.
    triangles : int
        Maximum number of triangles of all textured geoms.
    now : callable
        Returns the time [s].

    Raises
    ------
    AsperityError
        viser is not installed, or a value is out of range.

    Examples
    --------
    >>> with ModelPage(surfaces) as page:
    ...     print(page.url)
    ...     while running:
    ...         surfaces.step(data)
    ...         page.show(data)
    """

    def __init__(
        self,
        surfaces: Surfaces,
        *,
        port: int = 8080,
        triangles: int = _FINE,
        now: Callable[[], float] = time.perf_counter,
    ) -> None:
        require_between("triangles", triangles, FEWEST, MOST, "")
        self._model, self._now, self._shown = surfaces.model, now, -np.inf
        name = self._model.names.split(b"\0")[0].decode("utf-8", "replace")
        self.units = min(UNITS, _WIDE / float(self._model.stat.extent))
        """Units of the view per metre."""
        self.server: Any = start_server(LOCAL, port, f"asperity: {name}")
        set_up_view(self.server)
        self._frames = [
            self.server.scene.add_frame(f"/model/{b}", show_axes=False)
            for b in range(self._model.nbody)
        ]
        for body, shape in _shapes(surfaces, triangles):
            image = shape.atlas.image() if shape.atlas is not None else None
            add_shape(self.server, shape, f"/model/{body}", image=image, units=self.units)
        self._most = 1e-9
        self._size = self.units * float(self._model.stat.extent)
        ground = _ground(surfaces)
        if ground is not None:
            height, size = float(self._model.geom_pos[ground, 2]), self._size / self.units
            add_ground(self.server, height, size, self.units)
        self._flexes = [
            (flex, self._add_flex(flex))
            for flex in range(self._model.nflex)
            if self._model.flex_group[flex] <= _MOST_GROUP
        ]
        self._arrows = self.server.scene.add_arrows(
            "/forces", np.zeros((0, 2, 3), np.float32), CONTACT
        )
        self.panel: ModelPanel | None = None
        """Buttons and sliders, if `run_on_page` steps the model."""
        self._is_framed = False

    @property
    def url(self) -> str:
        """Address of the page."""
        return f"http://{self.server.get_host()}:{self.server.get_port()}"

    def show(self, data: mujoco.MjData) -> bool:
        """Show bodies and forces of the last step, at most 30 times a second.

        Returns whether they were shown. It may be called in every step.
        """
        if self._now() - self._shown < 1.0 / UPDATE_RATE:
            return False
        self._shown = self._now()
        if not self._is_framed:
            self._is_framed = True
            self._frame(data)
        points, forces = contact_forces(self._model, data)
        size = np.linalg.norm(forces, axis=1)
        self._most = max(_FADING * self._most, float(size.max(initial=0.0)))
        ends = self.units * points + _LONGEST * self._size / self._most * forces
        with self.server.atomic():
            for b, frame in enumerate(self._frames):
                place(frame, np.append(data.xpos[b], data.xquat[b]), self.units)
            for flex, mesh in self._flexes:
                mesh.vertices = self._flex_vertices(data, flex)
            self._arrows.points = np.stack([self.units * points, ends], axis=1).astype(np.float32)
            if self.panel is not None:
                self.panel.show(data, forces)
        return True

    def _frame(self, data: mujoco.MjData) -> None:
        """Fit the cameras of browsers to the model's first state, without planes."""
        radius = self._model.geom_rbound[:, None]
        is_seen = (self._model.geom_group <= _MOST_GROUP) & (radius[:, 0] > 0.0)
        places = np.concatenate([
            (data.geom_xpos - radius)[is_seen], (data.geom_xpos + radius)[is_seen],
            data.flexvert_xpos.reshape(-1, 3),
        ])  # fmt: skip
        if not len(places):
            return
        low, high = self.units * places.min(axis=0), self.units * places.max(axis=0)
        size = float(np.linalg.norm(high - low))
        self._size = size
        self._arrows.shaft_radius, self._arrows.head_radius = 0.006 * size, 0.015 * size
        self._arrows.head_length = 0.04 * size
        first, middle = self.server.initial_camera, 0.5 * (low + high)
        first.position = tuple(middle + size * _FROM)
        first.look_at, first.up = tuple(middle), (0.0, 0.0, 1.0)
        first.fov = np.radians(_FIELD_OF_VIEW)
        first.near, first.far = 0.01 * size, 100.0 * size

    def _add_flex(self, flex: int) -> Any:
        """Add a flex with moving vertices; it is drawn without its texture."""
        model, start = self._model, mujoco.MjData(self._model)
        mujoco.mj_forward(model, start)
        colour = tuple((255.0 * model.flex_rgba[flex, :3]).round().astype(int).tolist())
        return self.server.scene.add_mesh_simple(
            f"/flex/{flex}", self._flex_vertices(start, flex), flex_triangles(model, flex),
            color=colour, side="double" if model.flex_dim[flex] == 2 else "front",
        )  # fmt: skip

    def _flex_vertices(self, data: mujoco.MjData, flex: int) -> NDArray[np.float32]:
        """Return the vertices of a flex in units of the view, (n, 3)."""
        start, count = int(self._model.flex_vertadr[flex]), int(self._model.flex_vertnum[flex])
        return (self.units * data.flexvert_xpos[start : start + count]).astype(np.float32)

    def close(self) -> None:
        """Stop the server of the page."""
        stop_server(self.server)

    def __enter__(self) -> ModelPage:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def surfaces_of_file(path: Path) -> Surfaces:
    """Return the textured surfaces of the model in a file, MJCF or URDF.

    `textures.toml` beside it gives the textures, else its `<custom>` texts.
    """
    if not path.is_file():
        raise AsperityError(f"no model file {path}")
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise AsperityError(f"{path}: {str(error).splitlines()[0]}") from None
    beside = path.with_name("textures.toml")
    return attach(model, beside if beside.is_file() else None)


def run_on_page(surfaces: Surfaces, page: ModelPage, seconds: float | None = None) -> float:
    """Run a model in real time on a page, until Ctrl-C or for `seconds`; return its time [s]."""
    model = surfaces.model
    data = mujoco.MjData(model)
    page.panel = panel = ModelPanel(page.server, surfaces)
    panel.start(data)
    started, dt = time.perf_counter(), model.opt.timestep
    begun = started - data.time
    with contextlib.suppress(KeyboardInterrupt):
        while seconds is None or time.perf_counter() - started < seconds:
            late = time.perf_counter() - begun - data.time
            if panel.act(data) or panel.is_paused:
                time.sleep(_IDLE)
                begun = time.perf_counter() - data.time
            elif late < 0.0:
                time.sleep(-late)
            else:
                if late > _BEHIND:
                    begun += late  # too slow for real time: it runs as fast as it can
                surfaces.step(data, max(1, min(int(late / dt), _MOST_STEPS)))
            page.show(data)
    return float(data.time)


def contact_forces(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[Array, Array]:
    """Return points (n, 3) [m] and forces (n, 3) [N] of all contacts.

    A force is that on the second geom, or on the first if only that one can move.
    """
    points, forces, force = np.zeros((data.ncon, 3)), np.zeros((data.ncon, 3)), np.zeros(6)
    for i in range(data.ncon):
        mujoco.mj_contactForce(model, data, i, force)
        points[i] = data.contact[i].pos
        forces[i] = data.contact[i].frame.reshape(3, 3).T @ force[:3]
        fixed = [geom >= 0 and model.body_weldid[model.geom_bodyid[geom]] == 0
                 for geom in data.contact[i].geom.tolist()]  # fmt: skip
        if fixed == [False, True]:
            forces[i] *= -1.0
    return points, forces


def _shapes(surfaces: Surfaces, triangles: int) -> list[tuple[int, Drawable]]:
    """Return the drawn shapes, each with the number of its body in the model, in its frame."""
    model = surfaces.model
    textured = [one for one in surfaces.bodies if one.is_textured]
    covered: set[int | None] = {geom for one in textured for geom in one.geoms}
    shown = [(one.carrier, one.local, one.body, one.geoms[0]) for one in textured]
    covered.add(_ground(surfaces))
    for geom in range(model.ngeom):
        is_seen = model.geom_group[geom] <= _MOST_GROUP and geom_rgba(model, geom)[3] > 0.0
        body = _plain(model, geom) if is_seen and geom not in covered else None
        if body is not None:
            frame = frame_of(model.geom_pos[geom], model.geom_quat[geom])
            shown.append((int(model.geom_bodyid[geom]), frame, body, geom))
    whole = [
        (carrier, frame, Part(one, None, geom_rgba(model, geom)[:3], _HERE, False))
        for carrier, frame, body, geom in shown
        for one in body.parts
    ]
    radius = float(model.stat.extent)
    views = [ViewBall(np.zeros(3), radius, 100) for _ in whole]
    shapes = shapes_of_parts([part for _, _, part in whole], views, 0.5 * radius, triangles)
    return [
        (carrier, replace(
            shape, vertices=shape.vertices @ frame[:, :3].T + frame[:, 3],
            normals=shape.normals @ frame[:, :3].T,
        ))
        for (carrier, frame, _), shape in zip(whole, shapes, strict=True)
        if len(shape.faces)
    ]  # fmt: skip


def _ground(surfaces: Surfaces) -> int | None:
    """Return the ground geom: a level plane of the world without texture, if any."""
    model = surfaces.model
    textured = {geom for one in surfaces.bodies if one.is_textured for geom in one.geoms}
    for geom in np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE).tolist():
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
        is_level = turn[8] > 1.0 - 1e-6 and model.geom_bodyid[geom] == 0
        if is_level and geom not in textured and model.geom_group[geom] <= _MOST_GROUP:
            return geom
    return None


def _plain(model: mujoco.MjModel, geom: int) -> Body | None:
    """Return a geom without a texture as a body in its own frame; None for a height field."""
    kind = mujoco.mjtGeom(int(model.geom_type[geom]))
    name = geom_name(model, geom)
    if kind != mujoco.mjtGeom.mjGEOM_MESH:
        is_simple = kind in GEOMS
        return Body(name, [Geom(GEOMS[kind], model.geom_size[geom])]) if is_simple else None
    mesh = mesh_from_arrays(*model_mesh(model, int(model.geom_dataid[geom])), hard_angle=HARD_ANGLE)
    return Body(name, [Geom("mesh", np.ptp(mesh.vertices, axis=0) / 2 + 1e-9)], mesh=mesh)
