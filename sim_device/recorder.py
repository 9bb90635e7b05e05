"""The transient recorder: settings, states and the acquisition that runs from INIT to a held record."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import Any

from sim_device import stream
from sim_device.acquisition import Acquisition, Setup, State
from sim_device.errors import DeviceError
from sim_device.faults import Faults
from sim_device.gate import MOST_EDGES
from sim_device.memory import Memory, Record
from sim_device.settings import Rig
from sim_device.stream import Drop

LOOK_AHEAD_NS = 250_000_000
"""How far ahead the comparator looks at noise alone, when its level lies within it."""
EDGES_BELONG = 5e9
"""ns after the trigger for which gate edges still belong to its record."""


class Recorder:
    """States and acquisition; times of day are the monotonic clock's, in ns."""

    def __init__(
        self, memory: Memory, faults: Faults, rig: Callable[[], Rig], seed: int, log: Callable[[str], None]
    ) -> None:
        """After power on: holding what the memory holds."""
        self.memory, self.faults, self._rig, self._seed, self._log = memory, faults, rig, seed, log
        self.setup = Setup()
        self.state = State.HELD if memory.held else State.IDLE
        self.started = time.monotonic_ns()
        self.acquisition: Acquisition | None = None
        self.drop: Drop | None = None
        self._task: asyncio.Task[None] | None = None
        self._released = asyncio.Event()
        self._contact_input = asyncio.Event()

    def configure(self, **changes: Any) -> None:
        """Change settings, all or none."""
        if self.state not in (State.IDLE, State.HELD):
            raise DeviceError(-221)
        self.setup = self.setup.changed(**changes)

    def init(self) -> None:
        """Idle → filling."""
        if self.state is not State.IDLE:
            raise DeviceError(-213)
        record_id = self.memory.new_id()
        run = Acquisition(record_id, self.setup, float(time.monotonic_ns()))
        if self.drop is not None and self.drop.moving():
            run.origin = self.drop.on_grid(run.origin, self.setup.interval_ns)
        self.acquisition, self.state = run, State.FILLING
        self._contact_input.clear()
        self._task = asyncio.get_running_loop().create_task(self._acquire(run))
        self._task.add_done_callback(self._ended)
        self._log(f"record {record_id}: filling")

    def _ended(self, task: asyncio.Task[None]) -> None:
        if not task.cancelled() and (error := task.exception()) is not None:
            self._log(f"the acquisition broke off: {error!r}")
            self.forget()

    def abort(self) -> None:
        """Filling, armed → idle. A record whose trigger has come goes on to its end."""
        if self.state in (State.FILLING, State.ARMED):
            self._log("acquisition aborted")
            self.forget()

    def forget(self) -> None:
        """End whatever is under way, as power loss does; a held record stays."""
        if self._task is not None:
            self._task.cancel()
            self._task = None
        self.acquisition = None
        if self.state is not State.HELD:
            self.state = State.IDLE

    def reset(self) -> None:
        """``*RST``: settings as after reset, not armed; a record that is measuring or held stays."""
        self.abort()
        self.setup = Setup()

    def power_on(self) -> None:
        """After power loss: as new, but for the memory."""
        self.forget()
        self.setup = Setup()
        self.started = time.monotonic_ns()

    def acknowledge(self, record_id: int, crc: int) -> None:
        """Held → idle if both are right, else DeviceError −230."""
        held = self.memory.held
        if self.state is not State.HELD or held is None or (held.id, held.crc(0)) != (record_id, crc):
            raise DeviceError(-230)
        self.memory.hold(None)
        self.state = State.IDLE
        self._log(f"record {record_id}: acknowledged")

    def released(self, drop: Drop) -> None:
        """The dart has been let go: an acquisition under way will see the drop."""
        if self.acquisition is not None and self.state in (State.FILLING, State.ARMED, State.MEASURING):
            drop.snap(self.acquisition.origin, self.acquisition.setup.interval_ns)
        self.drop = drop
        self._released.set()

    def edge(self, at: float, free: bool) -> None:
        """A gate edge at ``at`` ns."""
        run = self.acquisition
        if not free:
            self._contact_input.set()
        if run is None or len(run.edges) >= MOST_EDGES:
            return
        if run.trigger is None or at - run.trigger < EDGES_BELONG:
            run.edges.append(at)
            held = self.memory.held
            if held is not None and held.id == run.id:
                held.edges_ns = self._edges(run)
                self.memory.save()

    def gate(self) -> tuple[int, list[int]]:
        """Record id and edges in ns from its trigger; 0 and none if no record has edges."""
        run = self.acquisition
        if run is not None and run.trigger is not None:
            edges = self._edges(run)
            return (run.id, edges) if edges else (0, [])
        held = self.memory.held
        return (held.id, held.edges_ns) if run is None and held is not None and held.edges_ns else (0, [])

    def _edges(self, run: Acquisition) -> list[int]:
        clock = self._rig().gate.clock_ns
        return [round((edge - (run.trigger or 0.0)) / clock) * clock for edge in run.edges]

    async def _until(self, at: float) -> None:
        await asyncio.sleep(max(0.0, (at - time.monotonic_ns()) / 1e9))

    async def _acquire(self, run: Acquisition) -> None:
        setup = run.setup
        await self._until(run.origin + setup.pretrigger * setup.interval_ns)
        self.state = State.ARMED
        self._contact_input.clear()
        self._log(f"record {run.id}: armed")
        await {"INT": self._level_trigger, "IMM": self._no_trigger, "EXT": self._contact_trigger}[setup.source](run)
        self.state = State.MEASURING
        trigger = run.trigger or 0.0
        self._log(f"record {run.id}: triggered")
        await self._until(trigger + setup.first_ns + setup.points * setup.interval_ns)
        if run.drop is None and self.drop is not None and self.drop.moving_at(trigger + setup.first_ns):
            run.drop, run.trigger_after_contact = self.drop, trigger - self.drop.contact
        counts = await asyncio.to_thread(self._take, run)
        if (fault := self.faults.strikes("stuck_bit")) is not None:
            counts = stream.with_stuck_bit(counts, int(fault.options["bit"]), bool(fault.options["at"]))
        record = Record(
            id=run.id, boot=self.memory.boot, hash=setup.hash, interval_ns=setup.interval_ns, first_ns=setup.first_ns,
            trigger_us=int((trigger - self.started) // 1000), bits=self._rig().sensor.bits,
            samples=counts.reshape(1, -1), edges_ns=self._edges(run),
        )  # fmt: skip
        self.memory.hold(record)
        self.state, self._task = State.HELD, None
        self._log(f"record {run.id}: held")

    def _take(self, run: Acquisition) -> Any:
        setup = run.setup
        if run.drop is not None:
            return run.drop.counts(run.trigger_after_contact + setup.first_ns, setup.interval_ns, setup.points)
        first = run.trigger_index + setup.first_ns // setup.interval_ns
        return stream.quiet(self._rig().sensor, (self._seed, 1, run.id), first, setup.points)

    def _fired(self, run: Acquisition, at: float) -> bool:
        if self.faults.strikes("missing_trigger") is not None:
            self._log(f"record {run.id}: fault missing_trigger")
            return False
        run.trigger = at
        return True

    async def _no_trigger(self, run: Acquisition) -> None:
        run.trigger_index = run.setup.pretrigger
        if not self._fired(run, run.origin + run.setup.pretrigger * run.setup.interval_ns):
            await asyncio.Event().wait()

    async def _contact_trigger(self, run: Acquisition) -> None:
        while True:
            await self._contact_input.wait()
            self._contact_input.clear()
            if self._fired(run, run.edges[-1] if run.edges else float(time.monotonic_ns())):
                return

    async def _level_trigger(self, run: Acquisition) -> None:
        setup, h, last_drop = run.setup, run.setup.interval_ns, 0
        index = setup.pretrigger
        while True:
            self._released.clear()
            drop, sensor = self.drop, self._rig().sensor
            if drop is not None and drop.moving() and drop.number != last_drop:
                last_drop = drop.number
                from_index = max(index, run.index_at(drop.release)) - drop.index(run.origin, h)
                found = await asyncio.to_thread(drop.crossing, setup, from_index)
                if found is not None:
                    after = drop.since_contact(found, h)
                    await self._until(drop.contact + after)
                    if self._fired(run, drop.contact + after):
                        run.drop, run.trigger_after_contact = drop, after
                        return
                await self._until(drop.contact + drop.motion.over * 1e9)
                index = run.index_at(time.monotonic_ns())
            elif stream.within_noise(sensor, setup.level):
                length = LOOK_AHEAD_NS // h
                key = (self._seed, 1, run.id)
                found = await asyncio.to_thread(stream.quiet_crossing, sensor, key, setup, index, length)
                index = index + length if found is None else found
                if not await self._release_before(run.origin + index * h) and found is not None:
                    run.trigger_index = found
                    if self._fired(run, run.origin + found * h):
                        return
                    index = found + 1
            else:
                await self._released.wait()

    async def _release_before(self, at: float) -> bool:
        """Wait until ``at`` (ns) or a release, whichever is first, and say whether it was the release."""
        try:
            await asyncio.wait_for(self._released.wait(), max(0.0, (at - time.monotonic_ns()) / 1e9))
        except TimeoutError:
            return False
        return True
