"""Textured surfaces of a MuJoCo model: attached once, felt in every step.

MuJoCo calls `mjcb_passive` in each forward and inverse pass, after contacts and constraints have
been made and before anything is computed from them. There the contacts of textured pairs are
replaced, and the constraints made again. So all that comes before and after is MuJoCo's own:
checks, cones, solvers, integrators, sensors, sleeping.
"""

from __future__ import annotations

import contextlib
import logging
import weakref
from collections.abc import Iterator, Mapping
from typing import Any

import mujoco

from asperity.contact.response.settings import ForceSettings
from asperity.errors import AsperityError, require_choice, require_not_negative, require_positive
from asperity.mujoco.bodies import carried_bodies
from asperity.mujoco.changes import AttachedModel
from asperity.mujoco.installed import callback, original, replaced_functions
from asperity.mujoco.margins import widen
from asperity.mujoco.memory import contact_type
from asperity.mujoco.pairs import PairPlan
from asperity.mujoco.replaced import Replaced

_logger = logging.getLogger(__name__)
MODES = ("contacts", "passive")
_SPRINGS_AND_DAMPERS = int(mujoco.mjtDisableBit.mjDSBL_SPRING | mujoco.mjtDisableBit.mjDSBL_DAMPER)


def attach(
    model: mujoco.MjModel,
    textures: Mapping[str, Any],
    *,
    stiffness: float = 1e4,
    dissipation: float = 1.0,
    settings: ForceSettings | None = None,
) -> Surfaces:
    """Give geoms of a model textures.

    Parameters
    ----------
    model : mujoco.MjModel
        Its textured geoms get a wider `geom_gap`, so that MuJoCo reports them to each other before
        they touch; what `mj_step` computes without textures stays the same.
    textures : mapping
        By the name of a geom, a body or a material ("geom:NAME" and so on where that is not
        clear); what is particular goes before what is general. Values: see `texture`, `pattern`;
        a `HeightField`, (array, pixel size [m]), the path of an image, a text such as
        "knurl:0.8mm".
    stiffness : float
        k of a contact [N/m], 1e-6 to 1e9: pressed with F it is F / k deep.
    dissipation : float
        a of Hunt & Crossley [s/m], 0 or above: the force of a contact that deepens at v is 1 + a v
        times that of one at rest.
    settings : ForceSettings, optional
        Of the search, where the defaults do not do: `max_nodes`, `tolerance`, `patch_radius`,
        `edge_fade`. Its stiffness, friction and dissipation are not used.

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
        model, textures, stiffness=stiffness, dissipation=dissipation, settings=settings
    )


class Surfaces:
    """Textures on the geoms of a model; made by `attach`.

    Attributes
    ----------
    model : mujoco.MjModel
    notes : tuple of str
        What was chosen and left out, one line each.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        textures: Mapping[str, Any],
        *,
        stiffness: float = 1e4,
        dissipation: float = 1.0,
        settings: ForceSettings | None = None,
    ) -> None:
        if not isinstance(model, mujoco.MjModel):
            raise AsperityError(f"model must be a mujoco.MjModel, got {type(model).__name__}")
        self.model = model
        chosen = _settings(settings, require_positive("stiffness", stiffness, "[N/m]"))
        self._dissipation = require_not_negative("dissipation", dissipation, "[s/m]")
        carried = carried_bodies(model, textures)
        self.notes = carried.notes
        for note in self.notes:
            _logger.info("%s", note)
        self._plan = PairPlan(model, carried, chosen)
        self._undo = widen(model, carried)
        self._snapshot = AttachedModel(model, carried)
        self._states: weakref.WeakKeyDictionary[mujoco.MjData, Replaced] = (
            weakref.WeakKeyDictionary()
        )
        contact_type()  # needs a model, and none can be compiled within the callback

    def step(self, data: mujoco.MjData, nstep: int = 1) -> None:
        """Advance `data` by `nstep` steps of `mujoco.mj_step`, with textures."""
        self._refuse_without_callback()
        with callback(self.model, self._replace):
            original("mj_step")(self.model, data, nstep)

    def forward(self, data: mujoco.MjData) -> None:
        """Do what `mujoco.mj_forward` does, with textures."""
        self._refuse_without_callback()
        with callback(self.model, self._replace):
            original("mj_forward")(self.model, data)

    def inverse(self, data: mujoco.MjData) -> None:
        """Do what `mujoco.mj_inverse` does, with textures."""
        self._refuse_without_callback()
        with callback(self.model, self._replace):
            original("mj_inverse")(self.model, data)

    @contextlib.contextmanager
    def installed(self, *, callback_too: bool = False) -> Iterator[Surfaces]:
        """Make loops that nobody changes feel the textures of this model, while the block runs.

        `mujoco.mj_step`, `mj_step1`, `mj_forward`, `mj_inverse` are replaced for this model;
        others go to MuJoCo's own. Blocks may be nested; an exception ends them as well. Names that
        were imported before, by `from mujoco import mj_step`, stay MuJoCo's own.

        Parameters
        ----------
        callback_too : bool
            Set MuJoCo's passive callback all the time, so that what calls MuJoCo from C feels
            textures too: the viewer's own loop, `mujoco.rollout`. Meanwhile no model can be
            compiled, by anyone, since MuJoCo would call it for models that Python does not know.
        """
        self._refuse_without_callback()
        manager = callback if callback_too else replaced_functions
        with manager(self.model, self._replace):
            yield self

    def detach(self) -> None:
        """Give the model back the margins that it had."""
        self._undo()

    def _replace(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Replace the contacts of textured pairs in `data`, unless that is done already."""
        state = self._states.get(data)
        if state is None:
            state = self._states[data] = Replaced(self._plan, model)
        if state.is_new(data.time):
            self._snapshot.check(model)
        state.replace(model, data, self._dissipation)

    def _refuse_without_callback(self) -> None:
        off = int(self.model.opt.disableflags) & _SPRINGS_AND_DAMPERS
        if off == _SPRINGS_AND_DAMPERS:
            raise AsperityError(
                "the model disables springs and dampers, and with both MuJoCo's passive forces, "
                "through which textures come in; enable one of them"
            )


def _settings(settings: ForceSettings | None, stiffness: float) -> ForceSettings:
    """Return settings without friction and damping, which are MuJoCo's here."""
    old = settings or ForceSettings()
    require_choice("law", old.law, ("otaduy-lin",))
    return ForceSettings(
        stiffness=stiffness, max_nodes=old.max_nodes, tolerance=old.tolerance,
        patch_radius=old.patch_radius, edge_fade=old.edge_fade,
    )  # fmt: skip
