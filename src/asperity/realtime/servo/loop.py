"""The servo loop, whose `tick` reads as what happens between two deadlines.

    device --> mapping --> handle's pose and velocity
           --> tool on its coupling, pushed by the last contact --> wrench that the hand feels
           --> passivity --> mapping --> safety --> device      --> snapshot, recorder
           --> contact asked for where the tool is now

The contact is computed beside the loop (`contact_worker`). In the modes of the coupling in which
the tool has a motion of its own, a tick takes the contact of the last one: there is a whole tick
to compute it in, and nothing waits. In the `direct` mode the hand feels the contact at the pose
just read, so the loop waits for it until `guard` of the tick is left.

If the contact is not there in time, the tick takes the last one there was, carried on to the
present pose by its stiffness, and counts as a fallback. A contact older than `STALE` is carried no
further: the hand feels nothing until a new one is there, which then comes up softly.
"""

from __future__ import annotations

import gc
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import Repeated
from asperity.dynamics.passivity.controller import PassivityController
from asperity.dynamics.virtual_coupling.coupled_tool import CoupledTool
from asperity.errors import AsperityError, require_between
from asperity.geometry.rigid_body import centre_of_mass, shift_wrench
from asperity.realtime.devices.mapping import Mapping
from asperity.realtime.servo.contact_worker import ContactSource
from asperity.realtime.servo.deadlines import BUSY, SPIN, Clock, Pace
from asperity.realtime.servo.publish import Publisher
from asperity.realtime.servo.safety import SafeDevice
from asperity.realtime.servo.stats import Stats
from asperity.realtime.servo.tick_row import TickRow
from asperity.simulation.tool_contact import CUT_SHORT, FALLBACK, LATE, PASSIVITY

GUARD = 0.25
"""Part of the tick that is kept for what comes after the contact, in the direct mode; ours."""
STALE = 0.25
"""A contact that was asked for so long ago [s] is not carried on any further; ours."""
STALLED = 0.05
"""After a pause of the whole loop longer than this [s] the wrench comes up softly; ours."""
FIRST_READING = 3.0
"""How long a device may take to its first reading [s]; ours."""


class ServoLoop:
    """One loop: a device, a tool, and what computes its contacts.

    Parameters
    ----------
    device : SafeDevice
        Open.
    mapping : Mapping
    tool : CoupledTool
    contacts : Contacts
    passivity : PassivityController
        Told not to be `active`, it only keeps the account.
    dt : float
        Tick [s].
    clock : Clock
    guard : float
        Part of the tick that is kept for what comes after the contact, 0.05 to 0.9.
    publisher : Publisher
    shares : bool
        Loop and contacts are on one core: between ticks it is the contact's first.
    busy : bool
        Watch the clock until the next tick, and do not sleep.
    """

    def __init__(
        self,
        device: SafeDevice,
        mapping: Mapping,
        tool: CoupledTool,
        contacts: ContactSource,
        passivity: PassivityController,
        *,
        dt: float,
        clock: Clock,
        guard: float = GUARD,
        publisher: Publisher | None = None,
        shares: bool = False,
        busy: bool = False,
    ) -> None:
        self.device, self.mapping, self.tool = device, mapping, tool
        self.contacts, self.passivity = contacts, passivity
        self.dt = dt
        self.stats = Stats()
        self.pace = Pace(dt, clock, spin=BUSY if busy else SPIN)
        self._work = self._rest if shares else None
        self._clock = clock
        self._guard = require_between("guard", guard, 0.05, 0.9)
        self._publisher = publisher or Publisher()
        self._row = TickRow()
        self._felt, self._sent, self._handle = np.zeros(6), np.zeros(6), np.zeros(7)
        self._corrected = False
        self._to_scene = _back(mapping)
        self._shift = Repeated(shift_wrench)
        self._shift(self._felt, np.zeros(3), self._felt)  # machine code is made before any hurry
        self._time = -dt
        self._tick = 0
        self._asked = self._have = -1
        """The ticks in which a contact was asked for last, and the one that we have."""

    def begin(self, start: NDArray[np.float64] | None) -> None:
        """Wait for the first reading, put the tool there, and look at the contact.

        Parameters
        ----------
        start : (7,) array, optional
            Where the hand's present pose is to be in the scene. Default: as the device says.
        """
        # What there is now stays; the loop itself makes no cycles to be collected.
        gc.collect()
        gc.freeze()
        gc.disable()
        clock, device = self._clock, self.device
        until = clock.now() + FIRST_READING
        while not device.read(clock.now()):
            if clock.now() > until:
                told = f": {device.counts.last_error}" if device.counts.last_error else ""
                raise AsperityError(
                    f"the device {device.name} gave no reading within {FIRST_READING:g} s{told}"
                )
            clock.sleep(1e-3)
        if start is not None:
            self.mapping.begin_at(device.reading, start)
        pose, _ = self.mapping.to_scene(device.reading)
        self.tool.reset(pose)
        self._handle[:] = pose
        self.contacts.submit(self.tool.pose, clock.now())
        if not self.contacts.wait(FIRST_READING):
            raise AsperityError(f"no contact was computed within {FIRST_READING:g} s")
        # The first contact may have taken long: what happened meanwhile is no tick's work.
        device.read(clock.now())
        device.begin(clock.now())
        self.pace.restart()

    def run(self, *, ticks: int | None = None, between: Callable[[], bool] = lambda: False) -> None:
        """Tick until `between`, asked after each, says to stop, or so many ticks were due.

        However it ends, the device is sent zero and is closed.
        """
        try:
            while ticks is None or self.stats.ticks + self.stats.skipped < ticks:
                self.pace.wait(self._work)
                self.tick()
                if between():
                    break
        finally:
            self.device.close()
            gc.enable()
            gc.unfreeze()

    def set_tick(self, dt: float) -> None:
        """Go on with ticks of `dt` [s]."""
        self.dt = dt
        self.device.set_tick(dt)
        self.pace.restart(dt)

    def tick(self) -> None:
        """Do what a tick has to do."""
        now, stages, device, tool = self._clock.now, self.stats.stages, self.device, self.tool
        begun = now()
        if self.pace.skipped * self.dt > STALLED:
            device.soften()
        device.read(begun)
        pose, twist = self.mapping.to_scene(device.reading)
        read = now()
        fallback = not self._contact_for(pose, read)
        contact = self.contacts.latest
        known = read - contact.asked < STALE
        waited = now()
        wrench = tool.advance(pose, twist, contact.linear)
        reach = centre_of_mass(tool.pose, tool.body.centre) - pose[:3]
        moved = now()
        felt = self._made_passive(wrench, pose)
        self._shift(felt, reach, felt)
        passive = now()
        device.write(self.mapping.to_device(felt), begun, known=known)
        self._account(reach)
        written = now()
        flags = contact.linear.flags | device.flags | (FALLBACK if fallback else 0)
        self._publish(pose, twist, flags | (PASSIVITY if self._corrected else 0))
        missed = now() > self.pace.deadline
        if missed:
            self._row.flags[0] = int(self._row.flags[0]) | LATE
        self._publisher.push(self._row)
        ended = now()
        for name, seconds in (
            ("read", read - begun), ("contact_wait", waited - read), ("tool", moved - waited),
            ("passivity", passive - moved), ("write", written - passive),
            ("publish", ended - written), ("tick", ended - begun),
        ):  # fmt: skip
            stages[name].add(seconds)
        self.stats.recent_tick.add(ended - begun, ended)
        self.stats.finished(
            skipped=self.pace.skipped, late=self.pace.late, missed=missed, fallback=fallback,
            cut_short=contact.linear.flags & CUT_SHORT != 0,
        )  # fmt: skip
        if not tool.is_direct:
            if self.contacts.take():  # late by less than this tick
                self._taken()
            if not self.contacts.busy:
                # Last of all: who computes it wants the interpreter's lock, and may want the core.
                self._ask(tool.pose, begun)
        self._tick += 1

    def _rest(self, seconds: float) -> None:
        """Leave the core to the contact for at most so long [s].

        After one that was late the next is asked for as soon as it is done: else this tick would
        end without, and the one after it would be a fallback too.
        """
        clock, contacts = self._clock, self.contacts
        until = clock.now() + seconds
        contacts.rest(seconds)
        if self._asked < self._tick - 1 and not self.tool.is_direct and contacts.take():
            self._taken()
            now = clock.now()
            self._ask(self.tool.pose, now, self._tick - 1)
            contacts.rest(until - now)

    def _contact_for(self, pose: NDArray[np.float64], now: float) -> bool:
        """Have the newest contact be `contacts.latest`; return whether it is this tick's."""
        contacts = self.contacts
        if contacts.take():
            self._taken()
        if not self.tool.is_direct:
            return self._have >= self._tick - 1
        if not contacts.busy:
            self._ask(pose, now)
            if contacts.wait(self.pace.deadline - self._guard * self.dt - now):
                self._taken()
        return self._have == self._tick

    def _ask(self, pose: NDArray[np.float64], now: float, tick: int | None = None) -> None:
        """Ask for the contact at a pose of this tick, or of the one given."""
        tick = self._tick if tick is None else tick
        jumped = tick > self._asked + 1
        self._asked = tick
        self.contacts.submit(pose, now, jumped=jumped)

    def _taken(self) -> None:
        self._have = self._asked
        self.stats.contact.add(self.contacts.latest.seconds)
        self.stats.recent_contact.add(self.contacts.latest.seconds, self._clock.now())

    def _made_passive(
        self, wrench: NDArray[np.float64], pose: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return what the passivity controller makes of a wrench about the centre of mass."""
        passed = 1 + self.pace.skipped
        port = self.tool.port_twist(self._handle, pose)
        if passed > 1:
            port /= passed
        self._handle[:] = pose
        before = self.passivity.interventions
        self._felt[:] = self.passivity.correct(wrench, port, passed * self.dt)
        self._corrected = self.passivity.interventions > before
        self.stats.passivity += self._corrected
        return self._felt

    def _account(self, reach: NDArray[np.float64]) -> None:
        """Work out what was sent, as the scene sees it, about the centre of mass."""
        sent = self._sent
        np.matmul(self._to_scene, self.device.sent, out=sent)
        self._shift(sent, -reach, sent)
        self.passivity.sent(sent)

    def _publish(
        self,
        pose: NDArray[np.float64],
        twist: NDArray[np.float64],
        flags: int,
    ) -> None:
        row, stats, contact = self._row, self.stats, self.contacts.latest
        self._time += (1 + self.pace.skipped) * self.dt
        row.time[0] = self._time
        row.handle_pose[:] = pose
        row.tool_pose[:] = self.tool.pose
        row.contact_wrench[:] = contact.linear.wrench
        row.device_wrench[:] = self._sent
        row.contact_count[0] = contact.linear.count
        row.flags[0] = flags
        row.penetration_depth[0] = contact.depth
        if self._publisher.snapshot is not None and self._tick % self._publisher.every == 0:
            counts = (
                self.device.reading.buttons, stats.ticks, stats.misses, stats.fallbacks,
                stats.passivity, self.device.counts.silences,
                self.device.counts.clamped_force + self.device.counts.clamped_torque,
                stats.recent_tick.p99, stats.recent_contact.p99,
            )  # fmt: skip
            self._publisher.snapshot.write(
                row.values, twist, self.tool.twist, counts, contact.shown
            )


def _back(mapping: Mapping) -> NDArray[np.float64]:
    """Return the matrix (6, 6) from wrenches of the device to those of the scene.

    What the device cannot push has no way back: zero.
    """
    there = np.column_stack([mapping.to_device(unit).copy() for unit in np.eye(6)])
    return np.asarray(np.linalg.pinv(there), dtype=np.float64)
