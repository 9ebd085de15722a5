"""Textured surfaces of a MuJoCo model: attached once, active in every step.

MuJoCo calls `mjcb_passive` in each forward and inverse pass, after contacts and constraints have
been made and before anything is computed from them. There the contacts of textured pairs are
replaced, and the constraints rebuilt. Everything before and after is MuJoCo's own: checks, cones,
solvers, integrators, sensors, sleeping.
"""

from __future__ import annotations

import contextlib
import logging
import os
import weakref
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity._core.cores import usable_cores
from asperity.contact.response.settings import ForceSettings
from asperity.errors import AsperityError, require_choice, require_not_negative, require_positive
from asperity.mujoco.bodies import carried_bodies
from asperity.mujoco.changes import AttachedModel
from asperity.mujoco.flex_contacts import FlexContact
from asperity.mujoco.flexes import flex_surfaces
from asperity.mujoco.installed import call, callback, original, replaced_functions
from asperity.mujoco.margins import widen
from asperity.mujoco.memory import contact_type
from asperity.mujoco.model_textures import textures_of_file, textures_of_model
from asperity.mujoco.pairs import PairPlan
from asperity.mujoco.replaced import Replaced

_logger = logging.getLogger(__name__)
MODES = ("contacts", "passive")
_NODES = 100
"""Default of `max_nodes`: enough to find the deepest point along a path, but not to certify it."""
_PASSIVE = ("mjDSBL_SPRING", "mjDSBL_DAMPER", "mjDSBL_PASSIVE")
"""Flags without which there are no passive forces; the last one alone in older versions."""
_DISCRETE = int(getattr(mujoco.mjtIntegrator, "mjINT_DISCRETE", -1))
_NO_PASSIVE = sum(int(getattr(mujoco.mjtDisableBit, name, 0)) for name in _PASSIVE)


def attach(
    model: mujoco.MjModel,
    textures: Mapping[str, Any] | str | os.PathLike[str] | None = None,
    *,
    stiffness: float = 1e4,
    dissipation: float = 1.0,
    mode: str = "contacts",
    settings: ForceSettings | None = None,
) -> Surfaces:
    """Give geoms and flexes of a model textures.

    Parameters
    ----------
    model : mujoco.MjModel
        Its textured geoms and flexes get a wider gap, so that MuJoCo reports them to each other
        before they touch; what `mj_step` computes without textures stays the same.
    textures : mapping
        By the name of a geom, a body, a material or a flex ("geom:NAME" and so on if that is
        ambiguous); the more specific name takes precedence. Values: see `texture`, `pattern`; a
        `HeightField`, (array, pixel size [m]), the path of an image, a text such as "knurl:0.8mm";
        for a flex also a `Layer`. Or the path of a TOML file with tables `[textures.NAME]`; or
        None, for those in the model's `<custom>` texts (`model_textures`).
    stiffness : float
        k of a contact [N/m], 1e-6 to 1e9: under a force F its depth is F / k.
    dissipation : float
        a of Hunt & Crossley [s/m], 0 or above: the force of a contact whose depth grows at v is
        1 + a v times that of one at rest.
    mode : {"contacts", "passive"}
        "contacts": constraints of MuJoCo's solver. "passive": explicit forces in `qfrc_passive`,
        whose stiffness is limited by the step (`passive`); sensors do not see them as contacts.
    settings : ForceSettings, optional
        Of the search: `max_nodes` (by default 100 here, which finds the deepest point but seldom
        certifies it), `tolerance`, `patch_radius`. Its stiffness, friction and dissipation are not
        used.

    Returns
    -------
    Surfaces

    Raises
    ------
    AsperityError
        A name that the model does not have, a texture that cannot be used, one that is too tall for
        its geom, a value out of range; one line.
    """
    return Surfaces(
        model, textures, stiffness=stiffness, dissipation=dissipation, mode=mode, settings=settings
    )


class TexturedContacts(NamedTuple):
    """Textured contacts of one `MjData`, except those of flexes (`Surfaces.flex_contact`)."""

    numbers: NDArray[np.int64]
    """Their numbers in `data.contact`, (n,)."""
    slip: NDArray[np.float64]
    """Tangential velocity of the second geom relative to the first [m/s], world axes (n, 3)."""
    push: NDArray[np.float64]
    """Force along the normal by the law, without damping [N], (n,)."""


class Surfaces:
    """Textures on the geoms of a model; made by `attach`.

    Attributes
    ----------
    model : mujoco.MjModel
    notes : tuple of str
        Chosen defaults and ignored geoms, one line each.
    bodies : tuple of Carried
        The bodies with a texture, and those that they may touch.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        textures: Mapping[str, Any] | str | os.PathLike[str] | None = None,
        *,
        stiffness: float = 1e4,
        dissipation: float = 1.0,
        mode: str = "contacts",
        settings: ForceSettings | None = None,
    ) -> None:
        if not isinstance(model, mujoco.MjModel):
            raise AsperityError(f"model must be a mujoco.MjModel, got {type(model).__name__}")
        self.model = model
        chosen = _settings(settings, require_positive("stiffness", stiffness, "[N/m]"))
        self._dissipation = require_not_negative("dissipation", dissipation, "[s/m]")
        self.mode = require_choice("mode", mode, MODES)
        if textures is None:
            textures = textures_of_model(model)
        elif isinstance(textures, str | os.PathLike):
            textures = textures_of_file(textures)
        carried = carried_bodies(model, textures)
        self._flexes, notes = flex_surfaces(model, textures, carried)
        if self._flexes and mode == "passive":
            raise AsperityError(
                f"mode 'passive' has no textures for flexes, but {self._flexes[0].name} was given "
                "one; valid: 'contacts'"
            )
        self.notes, self.bodies = (*carried.notes, *notes), carried.bodies
        for note in self.notes:
            _logger.info("%s", note)
        self._plan = PairPlan(model, carried, chosen)
        self._undo = widen(model, carried, self._flexes)
        met = [one for flex in self._flexes for group in flex.bodies.values() for one in group]
        self._snapshot = AttachedModel(model, [*carried.bodies, *met])
        self._states: weakref.WeakKeyDictionary[mujoco.MjData, Replaced] = (
            weakref.WeakKeyDictionary()
        )
        contact_type()  # compiles a model, which is not possible within the callback

    def step(self, data: mujoco.MjData, nstep: int = 1) -> None:
        """Advance `data` by `nstep` steps of `mujoco.mj_step`, with textures."""
        self._refuse_without_callback()
        call(self.model, self._replace, original("mj_step"), self.model, data, nstep)

    def forward(self, data: mujoco.MjData) -> None:
        """Call `mujoco.mj_forward` with textures."""
        self._refuse_without_callback()
        call(self.model, self._replace, original("mj_forward"), self.model, data)

    def inverse(self, data: mujoco.MjData) -> None:
        """Call `mujoco.mj_inverse` with textures."""
        self._refuse_without_callback()
        call(self.model, self._replace, original("mj_inverse"), self.model, data)

    def step_all(
        self, datas: Sequence[mujoco.MjData], nstep: int = 1, threads: int | None = None
    ) -> None:
        """Advance many `MjData` by `nstep` steps each, on threads; by default as many as cores.

        Use this instead of `step` from several threads: MuJoCo has one callback for all of them.
        """
        self._refuse_without_callback()
        step = original("mj_step")
        with (
            callback(self.model, self._replace),
            ThreadPoolExecutor(threads or usable_cores()) as p,
        ):
            list(p.map(lambda data: step(self.model, data, nstep), datas))

    def contacts(self, data: mujoco.MjData) -> TexturedContacts:
        """Return the textured contacts of the last step of `data`.

        In mode "passive" they are not among `data.contact`, and `numbers` is empty.
        """
        state = self._states.get(data)
        count = 0 if state is None else state.count
        numbers = np.arange(count) + (0 if state is None else state.first)
        if state is None:
            return TexturedContacts(numbers, np.zeros((0, 3)), np.zeros(0))
        if self.mode == "passive":
            numbers = numbers[:0]
        sign = np.where(state.placed.is_second[:count], 1.0, -1.0)[:, None]
        return TexturedContacts(
            numbers, sign * state.placed.slip[:count], state.placed.push[:count].copy()
        )

    def flex_contact(self, data: mujoco.MjData, name: str) -> FlexContact:
        """Return the contact of a textured flex with all geoms in the last step of `data`.

        Raises
        ------
        AsperityError
            No flex of that name has a texture.
        """
        known = {one.name: one.flex for one in self._flexes}
        flex = known[f"flex {require_choice('flex', name, [one[6:-1] for one in known])!r}"]
        state = self._states.get(data)
        found = None if state is None else state.flexes.latest.get(flex)
        return found or FlexContact(
            np.zeros((int(self.model.flex_vertnum[flex]), 3)), 0.0, np.zeros(0, np.int64)
        )

    @contextlib.contextmanager
    def installed(self, *, callback_too: bool = False) -> Iterator[Surfaces]:
        """Give unmodified simulation loops the textures of this model, while the block runs.

        `mujoco.mj_step`, `mj_step1`, `mj_forward`, `mj_inverse` are replaced for this model; other
        models use MuJoCo's own. Blocks may be nested; an exception ends them as well. Names
        imported before, by `from mujoco import mj_step`, stay MuJoCo's own.

        Parameters
        ----------
        callback_too : bool
            Set MuJoCo's passive callback all the time, so that calls of MuJoCo from C have textures
            too: the viewer's own loop, `mujoco.rollout`. Meanwhile no model can be compiled in this
            process, since MuJoCo would call it for models that Python does not know.
        """
        self._refuse_without_callback()
        manager = callback if callback_too else replaced_functions
        with manager(self.model, self._replace):
            yield self

    @property
    def touched_pairs(self) -> int:
        """Number of textured pairs of bodies that have touched so far, in all `MjData`."""
        return len(set().union(*(state.known_pairs for state in self._states.values())))

    def detach(self) -> None:
        """Restore the margins of the model."""
        self._undo()

    def _replace(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Replace the contacts of textured pairs in `data`, unless they are replaced already."""
        state = self._states.get(data)
        if state is None:
            state = self._states[data] = Replaced(
                self._plan, self._flexes, model, self.mode == "passive"
            )
        if state.is_new(data.time):
            self._snapshot.check(model)
        state.replace(model, data, self._dissipation)

    def _refuse_without_callback(self) -> None:
        if int(self.model.opt.integrator) == _DISCRETE:
            raise AsperityError(
                "the integrator 'discrete' leaves no room for textured contacts among its "
                "constraints; valid: Euler, RK4, implicit, implicitfast"
            )
        if int(self.model.opt.disableflags) & _NO_PASSIVE == _NO_PASSIVE:
            raise AsperityError(
                "the model disables springs and dampers (in MuJoCo 3.3: passive forces), through "
                "which textures come in; enable one of them"
            )


def _settings(settings: ForceSettings | None, stiffness: float) -> ForceSettings:
    """Return settings without friction and damping, which are MuJoCo's here."""
    old = settings or ForceSettings(max_nodes=_NODES)
    require_choice("law", old.law, ("otaduy-lin",))
    return ForceSettings(
        stiffness=stiffness, max_nodes=old.max_nodes, tolerance=old.tolerance,
        patch_radius=old.patch_radius,
    )  # fmt: skip
