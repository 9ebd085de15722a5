"""The servo loop; its method `tick` is the sequence of steps between two deadlines.

    device --> mapping --> handle's pose and velocity
           --> tool on its virtual coupling, pushed by the last contact --> wrench on the hand
           --> passivity --> mapping --> safety --> device      --> snapshot, recorder
           --> contact requested at the tool's new pose

The contact is computed beside the loop (`contact_worker`). In the coupling modes in which the tool
moves independently of the hand, a tick uses the contact that the previous tick requested: there is
a whole tick to compute it in, and nothing waits. In the `direct` mode the hand feels the contact at
the pose just read, so the loop waits for it until `guard` of the tick remains.

If a contact misses its deadline, the previous one is extrapolated to the present pose using its
stiffness, and the tick counts as a fallback. A contact older than `STALE` is not extrapolated: zero
is sent until a new one is there, whose wrench then rises softly.
"""

from __future__ import annotations

import gc
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import Repeated
from asperity.dynamics.linear_contact import LinearContact
from asperity.dynamics.passivity.controller import PassivityController
from asperity.dynamics.virtual_coupling.coupled_tool import CoupledTool
from asperity.errors import AsperityError, require_between
from asperity.geometry.rigid_body import centre_of_mass, shift_wrench
from asperity.realtime.devices.mapping import Mapping
from asperity.realtime.servo.contact_worker import ContactWorker
from asperity.realtime.servo.deadlines import BUSY, SPIN, Pace, SystemClock
from asperity.realtime.servo.ipc import TickRecord, TickRing
from asperity.realtime.servo.safety import SafeDevice
from asperity.realtime.servo.snapshot import SnapshotWriter
from asperity.realtime.servo.stats import Stats
from asperity.simulation.tool_contact import CUT_SHORT, FALLBACK, LATE, PASSIVITY

GUARD = 0.25
"""Share of a tick kept free after the contact in the direct mode; project default."""
STALE = 0.25
"""Age beyond which a contact is no longer extrapolated [s]; project default."""
STALLED = 0.05
"""Pause of the whole loop after which the wrench rises softly [s]; project default."""
FIRST_READING = 3.0
"""Time limit for a device's first reading and for the first contact [s]; project default."""


class ServoLoop:
    """One loop: a device, a tool, and a source of contacts.

    Parameters
    ----------
    device : SafeDevice
        Open.
    mapping : Mapping
    tool : CoupledTool
    contacts : ContactWorker
    passivity : PassivityController
        If it is not `active`, it only keeps the energy account.
    dt : float
        Tick [s].
    clock : SystemClock
    guard : float
        Share of a tick kept free after the contact in the direct mode, 0.05 to 0.9.
    ring : TickRing, optional
        Gets every tick.
    snapshot : SnapshotWriter, optional
        Gets every tick whose number is a multiple of `snapshot_every`.
    snapshot_every : int
    shares : bool
        Whether loop and contacts share a core; between ticks the contact has precedence.
    busy : bool
        Whether to poll the clock until the next tick instead of sleeping.
    """

    def __init__(
        self,
        device: SafeDevice,
        mapping: Mapping,
        tool: CoupledTool,
        contacts: ContactWorker,
        passivity: PassivityController,
        *,
        dt: float,
        clock: SystemClock,
        guard: float = GUARD,
        ring: TickRing | None = None,
        snapshot: SnapshotWriter | None = None,
        snapshot_every: int = 1,
        shares: bool = False,
        busy: bool = False,
    ) -> None:
        self.device, self.mapping, self.tool = device, mapping, tool
        self.contacts, self.passivity = contacts, passivity
        self.dt = dt
        self.stats = Stats()
        self.pace = Pace(dt, clock, spin=BUSY if busy else SPIN)
        self._between_work = self._yield_core if shares else None
        self._clock = clock
        self._guard = require_between("guard", guard, 0.05, 0.9)
        self._ring, self._snapshot, self._snapshot_every = ring, snapshot, snapshot_every
        self._tick_record = TickRecord()
        self._felt, self._sent, self._handle = np.zeros(6), np.zeros(6), np.zeros(7)
        self._corrected = False
        self._to_scene = _device_to_scene(mapping)
        self._shift_wrench = Repeated(shift_wrench)
        self._shift_wrench(self._felt, np.zeros(3), self._felt)  # compiles, before the first tick
        self._time = -dt
        self._tick = 0
        self._submitted_tick = self._contact_tick = -1
        """The tick that requested a contact last, and the tick whose contact is the latest."""

    def begin(self, start: NDArray[np.float64] | None) -> None:
        """Wait for the first reading, put the tool there, and compute the first contact.

        Parameters
        ----------
        start : (7,) array, optional
            Pose in the scene to which the hand's present pose is mapped. Default: as `mapping` has
            it.

        Raises
        ------
        AsperityError
            There was no reading or no contact within `FIRST_READING`.
        """
        # The garbage collector would pause the loop; ticks leave no cycles behind.
        gc.collect()
        gc.freeze()
        gc.disable()
        clock, device = self._clock, self.device
        until = clock.now() + FIRST_READING
        while not device.read(clock.now()):
            if clock.now() > until:
                reason = f": {device.counts.last_error}" if device.counts.last_error else ""
                raise AsperityError(
                    f"the device {device.name} gave no reading within {FIRST_READING:g} s{reason}"
                )
            clock.sleep(1e-3)
        if start is not None:
            self.mapping.begin_at(device.reading, start)
        pose, _ = self.mapping.to_scene(device.reading)
        # In balance, so that a tool whose handle starts inside an object is not thrown out.
        self.tool.settle(pose, self._first_contact)
        _ = self.tool.energy  # loads its kernel: a tick that needs it first would be some ms late
        self._handle[:] = pose
        # The first contact may have taken long; readings made meanwhile are discarded.
        device.read(clock.now())
        device.begin(clock.now())
        self.pace.restart()

    def _first_contact(self, pose: NDArray[np.float64]) -> LinearContact:
        """Return the contact at a pose, before the loop runs."""
        self.contacts.submit(pose, self._clock.now(), jumped=True)
        if not self.contacts.wait(FIRST_READING):
            raise AsperityError(f"no contact was computed within {FIRST_READING:g} s")
        return self.contacts.latest.linear

    def run(self, *, ticks: int | None = None, between: Callable[[], bool] = lambda: False) -> None:
        """Tick until `ticks` were due, or `between`, called after each tick, returns true.

        However the loop ends, zero is sent and the device is closed.
        """
        try:
            while ticks is None or self.stats.ticks + self.stats.skipped < ticks:
                self.pace.wait(self._between_work)
                self.tick()
                if between():
                    break
        finally:
            self.device.close()
            gc.enable()
            gc.unfreeze()

    def set_tick(self, dt: float) -> None:
        """Continue with ticks of `dt` [s]."""
        self.dt = dt
        self.device.set_tick(dt)
        self.pace.restart(dt)

    def tick(self) -> None:
        """Read the device, move the tool, send its wrench, publish, request the next contact."""
        now, stages, device, tool = self._clock.now, self.stats.stages, self.device, self.tool
        begun = now()
        if self.pace.skipped * self.dt > STALLED:
            device.soften()
        device.read(begun)
        pose, twist = self.mapping.to_scene(device.reading)
        read = now()
        fallback = not self._contact_for(pose, read)
        contact = self.contacts.latest
        known = read - contact.submitted < STALE
        waited = now()
        wrench = tool.advance(pose, twist, contact.linear)
        reach = centre_of_mass(tool.pose, tool.body.centre) - pose[:3]
        moved = now()
        felt = self._passive_wrench(wrench, pose)
        self._shift_wrench(felt, reach, felt)
        passive = now()
        device.write(self.mapping.to_device(felt), begun, known=known)
        self._account_sent(reach)
        written = now()
        flags = contact.linear.flags | device.flags | (FALLBACK if fallback else 0)
        self._publish(pose, twist, flags | (PASSIVITY if self._corrected else 0))
        missed = now() > self.pace.deadline
        if missed:
            self._tick_record.flags[...] = int(self._tick_record.flags) | LATE
        if self._ring is not None:
            self._ring.push(self._tick_record.record)
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
                self._count_contact()
            if not self.contacts.busy:
                # Last of all, because the worker takes the interpreter's lock and perhaps the core.
                self._submit(tool.pose, begun)
        self._tick += 1

    def _yield_core(self, seconds: float) -> None:
        """Leave the core to the contact for at most `seconds` [s].

        If the contact was late, request the next one as soon as it is done; otherwise this tick
        would request none, and the following one would be a fallback too.
        """
        clock, contacts = self._clock, self.contacts
        until = clock.now() + seconds
        contacts.rest(seconds)
        if self._submitted_tick < self._tick - 1 and not self.tool.is_direct and contacts.take():
            self._count_contact()
            now = clock.now()
            self._submit(self.tool.pose, now, self._tick - 1)
            contacts.rest(until - now)

    def _contact_for(self, pose: NDArray[np.float64], now: float) -> bool:
        """Take the newest contact into `contacts.latest`; return whether it is this tick's."""
        contacts = self.contacts
        if contacts.take():
            self._count_contact()
        if not self.tool.is_direct:
            return self._contact_tick >= self._tick - 1
        if not contacts.busy:
            self._submit(pose, now)
            if contacts.wait(self.pace.deadline - self._guard * self.dt - now):
                self._count_contact()
        return self._contact_tick == self._tick

    def _submit(self, pose: NDArray[np.float64], now: float, tick: int | None = None) -> None:
        """Request the contact at the pose of this tick, or of the given one."""
        tick = self._tick if tick is None else tick
        jumped = tick > self._submitted_tick + 1
        self._submitted_tick = tick
        self.contacts.submit(pose, now, jumped=jumped)

    def _count_contact(self) -> None:
        self._contact_tick = self._submitted_tick
        self.stats.contact.add(self.contacts.latest.seconds)
        self.stats.recent_contact.add(self.contacts.latest.seconds, self._clock.now())

    def _passive_wrench(
        self, wrench: NDArray[np.float64], pose: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the wrench about the centre of mass as the passivity controller corrects it."""
        passed = 1 + self.pace.skipped
        port = self.tool.port_twist(self._handle, pose)
        if passed > 1:
            port /= passed
        self._handle[:] = pose
        before = self.passivity.interventions
        self._felt[:] = self.passivity.correct(
            wrench, port, passed * self.dt, stored=self.tool.potential
        )
        self._corrected = self.passivity.interventions > before
        if self._corrected and not self.tool.is_direct:
            held = self.tool.energy + self.contacts.latest.linear.energy
            self.passivity.forgive(held, passed * self.dt)
        self.stats.passivity += self._corrected
        return self._felt

    def _account_sent(self, reach: NDArray[np.float64]) -> None:
        """Enter the wrench that was sent, about the centre of mass, into the energy account."""
        sent = self._sent
        np.matmul(self._to_scene, self.device.sent, out=sent)
        self._shift_wrench(sent, -reach, sent)
        self.passivity.sent(sent)
        if self.device.is_rising:
            self.passivity.grant(self.tool.potential)

    def _publish(self, pose: NDArray[np.float64], twist: NDArray[np.float64], flags: int) -> None:
        record, stats, contact = self._tick_record, self.stats, self.contacts.latest
        self._time += (1 + self.pace.skipped) * self.dt
        record.time[...] = self._time
        record.handle_pose[:] = pose
        record.tool_pose[:] = self.tool.pose
        record.contact_wrench[:] = contact.linear.wrench
        record.device_wrench[:] = self._sent
        record.contact_count[...] = contact.linear.count
        record.flags[...] = flags
        record.penetration_depth[...] = contact.depth
        if self._snapshot is not None and self._tick % self._snapshot_every == 0:
            counts = (
                self.device.reading.buttons, stats.ticks, stats.misses, stats.fallbacks,
                stats.passivity, self.device.counts.silences,
                self.device.counts.clamped_force + self.device.counts.clamped_torque,
                stats.recent_tick.p99, stats.recent_contact.p99,
            )  # fmt: skip
            self._snapshot.write(record, twist, self.tool.twist, counts, contact.shown)


def _device_to_scene(mapping: Mapping) -> NDArray[np.float64]:
    """Return the matrix (6, 6) from wrenches of the device to wrenches of the scene.

    Components that the device cannot render map to zero.
    """
    there = np.column_stack([mapping.to_device(unit).copy() for unit in np.eye(6)])
    return np.asarray(np.linalg.pinv(there), dtype=np.float64)
