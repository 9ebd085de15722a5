"""Replacement of the contacts of one `MjData` by asperity's."""

from __future__ import annotations

import math
import warnings

import mujoco
import numpy as np

from asperity._core.kernels import Repeated
from asperity.contact.body_contact import BodyContact
from asperity.mujoco.flex_contacts import FlexContacts
from asperity.mujoco.flexes import FlexSurface
from asperity.mujoco.memory import contact_records
from asperity.mujoco.pairs import PairPlan
from asperity.mujoco.passive import LONGEST, add_forces, warn_of_step
from asperity.mujoco.places import Places, places
from asperity.mujoco.put_in import Bodies, Taken, Velocities, put_in
from asperity.mujoco.rows import (
    LIGHT,
    found,
    placed,
    relative_pose,
    rows_of,
    set_constraints,
    take_out,
)

_ROOM = 4096
"""Maximum number of MuJoCo's contacts between textured pairs, and of asperity's, in one step."""
_PLACES = 48
"""Maximum number of stored places for each pair."""
_CHECK_STEPS = 256
"""Steps between two checks of the model for changes."""
_ADHESION = int(mujoco.mjtTrn.mjTRN_BODY)


class Replaced:
    """State of the contacts of one `MjData`.

    Attributes
    ----------
    first, count : int
        Number of asperity's first contact in `data.contact`, and their count.
    placed : PlacedContacts
        Force and stiffness of each.
    flexes : FlexContacts
        Those of flexes, which follow them.
    """

    def __init__(
        self, plan: PairPlan, flexes: tuple[FlexSurface, ...], model: mujoco.MjModel,
        as_forces: bool,
    ) -> None:  # fmt: skip
        self._plan, self._as_forces = plan, as_forces
        self.flexes = FlexContacts(flexes, plan.tables.friction)
        self._contacts: dict[int, BodyContact] = {}
        self._places: dict[int, Places] = {}
        self._room = plan.room() if plan.pairs else None
        self._found = found(_ROOM, len(plan.pairs))
        self._touched: set[int] = set()
        self._time = -math.inf
        self._calls = 0
        self._records: np.ndarray | None = None
        self._pose, self._motion = np.zeros(7), np.zeros((2, 3, 4))
        self.placed = placed(_ROOM)
        self.first = self.count = 0
        self._take, self._put, self._set, self._relative = (
            Repeated(take_out), Repeated(put_in), Repeated(set_constraints), Repeated(relative_pose)
        )  # fmt: skip
        self._sticks = bool((model.actuator_trntype == _ADHESION).any())
        self._root = model.body_rootid
        self._warned: set[int] = set()

    @property
    def known_pairs(self) -> set[int]:
        """Numbers of the pairs that have been near each other."""
        return set(self._contacts)

    def is_new(self, time: float) -> bool:
        """Return whether to check the model: at first, after a reset, and every 256 steps."""
        self._calls += 1
        return time < self._time or self._calls % _CHECK_STEPS == 1

    def replace(self, model: mujoco.MjModel, data: mujoco.MjData, dissipation: float) -> None:
        """Replace the contacts of textured pairs; rebuild the constraints."""
        dt = data.time - self._time
        if dt < 0.0:
            self._forget()
        step = float(model.opt.timestep)
        dt = step if not 0.0 <= dt < math.inf else dt
        self._time = data.time
        count = data.ncon
        if count == 0:
            self._leave(set(), dt)
            self.first = self.count = 0
            self.flexes.latest = {}
            return
        if self._records is None:
            self._records = contact_records(model, data)
            self._templates = np.zeros(_ROOM, self._records.dtype)
            self._taken = Taken(self._templates, self._found, self._plan.tables)
        records, tables = self._records, self._plan.tables
        kept, taken, near = self._take(records, count, tables, self._templates, self._found)
        if kept < 0:
            return
        kept = self.flexes.take(model, records, kept)
        if kept < 0:
            return
        pairs = self._found.near[:near].tolist()
        if self._touched and self._touched != set(pairs):
            self._leave(set(pairs), dt)
        self.first, self.count = kept, 0
        if not taken and not self.flexes.has_taken:
            return
        total = kept
        for number in pairs:
            total = self._add(data, number, dt, total, kept, taken)
        self.count = total - kept
        total = self.flexes.add(model, data, records, total)
        data.ncon = kept if self._as_forces else total
        if self._as_forces:  # before the constraints overwrite the memory of these contacts
            self._push(model, data, dissipation)
        mujoco.mj_makeConstraint(model, data)
        if not self._as_forces and self.count and data.nefc:
            worst, mass = self._set(
                records, kept, self.count, self.placed, rows_of(data), self._plan.by_facets,
                dissipation, step,
            )  # fmt: skip
            if worst >= 0 and mass > LIGHT:
                self._warn_of_mass(data, worst, mass, step)
        if data.nefc:
            self.flexes.constrain(model, data, records, dissipation)
        mujoco.mj_island(model, data)
        if self._sticks:
            mujoco.mj_transmission(model, data)
        mujoco.mj_projectConstraint(model, data)

    def _add(
        self, data: mujoco.MjData, number: int, dt: float, total: int, kept: int, taken: int
    ) -> int:
        """Append the contacts of one pair to the list; return the list's length."""
        pair = self._plan.pairs[number]
        contact = self._contacts.get(number)
        if contact is None:
            assert self._room is not None
            contact = self._contacts[number] = self._plan.contact(number, self._room)
            if pair.by_facets:
                self._places[number] = places(_PLACES, pair.slip, self._plan.least_distance(number))
            else:
                self._places[number] = places(0, 0.0, 0.0)
        self._relative(
            data.xpos, data.xmat, pair.carriers, pair.locals, pair.home, self._motion, self._pose
        )
        near = self._plan.candidates(self._found, taken)
        contact.wrench_at(self._pose, dt, near, lambda: near)
        self._touched.add(number)
        bodies = Bodies(
            number, pair.tool, pair.carriers, self._motion,
            Velocities(data.cvel, data.subtree_com, self._root), self._plan.stiffness, dt,
        )  # fmt: skip
        count: int = self._put(
            contact.contacts, self._records, (total, kept, taken),
            self._taken, bodies, self._places[number], self.placed,
        )  # fmt: skip
        return count

    def _push(self, model: mujoco.MjModel, data: mujoco.MjData, dissipation: float) -> None:
        """Add the forces of the contacts that were removed from the list."""
        assert self._records is not None
        records = self._records[self.first : self.first + self.count].copy()
        ratio, worst = add_forces(model, data, records, self.placed, dissipation)
        if worst >= 0 and ratio > LONGEST and int(self.placed.pair[worst]) not in self._warned:
            self._warned.add(int(self.placed.pair[worst]))
            warn_of_step(self._names(worst), ratio, float(model.opt.timestep))

    def _names(self, worst: int) -> tuple[str, str]:
        """Return the names of the bodies of one of the contacts."""
        bodies, pair = self._plan.carried.bodies, self._plan.pairs[int(self.placed.pair[worst])]
        return bodies[pair.tool].body.name, bodies[pair.others[0]].body.name

    def _leave(self, near: set[int], dt: float) -> None:
        """Update the state of pairs that are no longer near."""
        for number in self._touched - near:
            self._contacts[number].leave(dt)
            self._places[number].count[0] = 0
        self._touched &= near

    def _forget(self) -> None:
        """Forget all contacts after a reset of the simulation."""
        for contact in self._contacts.values():
            contact.reset()
        for remembered in self._places.values():
            remembered.count[0], remembered.still[0] = 0, 0.0
        self._touched.clear()

    def _warn_of_mass(self, data: mujoco.MjData, worst: int, mass: float, step: float) -> None:
        """Warn once for each pair that the step is too long for the stiffness."""
        number = int(self.placed.pair[worst])
        if number in self._warned:
            return
        self._warned.add(number)
        names = self._names(worst)
        enough = step / math.sqrt(1.0 + mass)
        warnings.warn(
            f"a step of {1e3 * step:.3g} ms is long for the stiffness of contact between "
            f"{names[0]} and {names[1]}: the contact gets {mass:.2g} times the mass of the bodies, "
            f"and forces at rest stay right; a step of {1e3 * enough:.2g} ms or less, or "
            f"{1.0 / (1.0 + mass):.2g} times the stiffness, needs none",
            stacklevel=2,
        )
