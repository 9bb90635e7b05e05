"""The transient recorder: settings, states and the acquisition that runs from INIT to a held record."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from sim_device import stream
from sim_device.acquisition import Acquisition, Setup, State
from sim_device.errors import DeviceError
from sim_device.faults import Faults
from sim_device.flaws import flawed
from sim_device.gate import MOST_EDGES
from sim_device.memory import Memory, Record
from sim_device.settings import Rig
from sim_device.stream import Counts, Drop
from sim_device.trigger import Trigger, until

EDGES_BELONG = 5e9
"""ns after the trigger for which gate edges still belong to its record."""


class Recorder:
    """States and acquisition; times of day are the monotonic clock's, in ns."""

    def __init__(
        self,
        memory: Memory,
        faults: Faults,
        rig: Callable[[], Rig],
        seed: int,
        log: Callable[[str], None],
        power_cycle: Callable[[], None],
    ) -> None:
        """After power on: holding what the memory holds."""
        self.memory, self.faults, self._rig, self._seed, self._log = memory, faults, rig, seed, log
        self._power_cycle = power_cycle
        self.trigger = Trigger(faults, rig, seed, log)
        self.setup = Setup()
        self.state = State.HELD if memory.held else State.IDLE
        self.started = time.monotonic_ns()
        self.acquisition: Acquisition | None = None
        self.captured: dict[str, Any] | None = None
        self._task: asyncio.Task[None] | None = None

    def configure(self, **changes: Any) -> None:
        """Change settings, all or none."""
        if self.state not in (State.IDLE, State.HELD):
            raise DeviceError(-221)
        setup = self.setup.changed(**changes)
        if "interval_ns" in changes and self.faults.strikes("clamped_settings") is not None:
            setup = replace(setup, interval_ns=1000 if setup.interval_ns == 2000 else 2000)
        self.setup = setup

    def init(self) -> None:
        """Idle → filling."""
        if self.state is not State.IDLE:
            raise DeviceError(-213)
        record_id = self.memory.new_id()
        run = Acquisition(record_id, self.setup, float(time.monotonic_ns()))
        drop = self.trigger.drop
        if drop is not None and drop.moving():
            run.origin = drop.on_grid(run.origin, self.setup.interval_ns)
        self.acquisition, self.state = run, State.FILLING
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

    def overwrite(self) -> None:
        """A fault: what is held is overwritten by a record of nothing."""
        held = self.memory.held
        if held is None:
            return
        record_id = self.memory.new_id()
        samples = self._quiet(record_id, 0, held.interval_ns, held.points)
        self.memory.hold(replace(held, id=record_id, samples=samples, edges_ns=[], crcs={}))
        self._log(f"record {held.id}: overwritten by {record_id}")

    def released(self, drop: Drop) -> None:
        """The dart has been let go: an acquisition under way will see the drop."""
        if self.acquisition is not None and self.state in (State.FILLING, State.ARMED, State.MEASURING):
            drop.snap(self.acquisition.origin, self.acquisition.setup.interval_ns)
        self.trigger.released(drop)

    def edge(self, at: float, free: bool) -> None:
        """A gate edge at ``at`` ns."""
        run = self.acquisition
        if not free:
            self.trigger.beam_broken()
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

    async def _acquire(self, run: Acquisition) -> None:
        setup = run.setup
        await until(run.origin + setup.pretrigger * setup.interval_ns)
        self.state = State.ARMED
        self._log(f"record {run.id}: armed")
        await self.trigger.wait(run)
        self.state = State.MEASURING
        self._log(f"record {run.id}: triggered")
        await self._measure(run)
        counts = await asyncio.to_thread(self._take, run)
        record = self._record(run, flawed(counts, self._rig().sensor.bits, self.faults))
        self.memory.hold(record)
        if record.id == run.id:
            self.captured = {"id": record.id, "crcs": [record.crc(channel) for channel in range(record.channels)]}
        self.state, self._task = State.HELD, None
        self._log(f"record {run.id}: held")

    async def _measure(self, run: Acquisition) -> None:
        """Until the last sample of the record."""
        setup, trigger = run.setup, run.trigger or 0.0
        if (fault := self.faults.strikes("double_trigger")) is not None:
            later = fault.options["seconds"] * 1e9
            run.trigger = trigger = trigger + later
            run.trigger_after_contact += later
            run.trigger_index += round(later / setup.interval_ns)
        if (fault := self.faults.strikes("short_pretrigger")) is not None:
            run.missing = min(int(fault.options["missing"]), setup.pretrigger)
        if (fault := self.faults.strikes("wrong_clock")) is not None:
            run.clock = fault.options["factor"]
        end = trigger + setup.first_ns + setup.points * setup.interval_ns
        if self.faults.strikes("brown_out") is not None:
            await until((trigger + end) / 2)
            asyncio.get_running_loop().call_soon(self._power_cycle)
            await asyncio.Event().wait()
        await until(end)
        drop = self.trigger.drop
        if run.drop is None and drop is not None and drop.moving_at(trigger + setup.first_ns):
            run.drop, run.trigger_after_contact = drop, trigger - drop.contact

    def _record(self, run: Acquisition, counts: Counts) -> Record:
        setup, trigger = run.setup, run.trigger or 0.0
        record = Record(
            id=run.id, boot=self.memory.boot, hash=setup.hash, interval_ns=setup.interval_ns, first_ns=run.first_ns,
            trigger_us=int((trigger - self.started) // 1000), bits=self._rig().sensor.bits,
            samples=counts, edges_ns=self._edges(run),
        )  # fmt: skip
        if self.faults.strikes("stale_record") is None:
            return record
        before = self._quiet(run.id - 1, 0, setup.interval_ns, setup.points)
        return replace(record, id=run.id - 1, samples=before, edges_ns=[])

    def _take(self, run: Acquisition) -> Counts:
        setup = run.setup
        if run.drop is None:
            return self._quiet(
                run.id, run.trigger_index + run.first_ns // setup.interval_ns, setup.interval_ns, setup.points
            )
        first, interval = run.trigger_after_contact + run.first_ns * run.clock, setup.interval_ns * run.clock
        channels = range(self._rig().recorder.channels)
        return np.stack([run.drop.counts(first, interval, setup.points, channel) for channel in channels])

    def _quiet(self, record_id: int, first: int, interval_ns: int, points: int) -> Counts:
        rig = self._rig()
        key = (self._seed, 1, record_id)
        return np.stack([stream.quiet(rig, key, first, points, channel) for channel in range(rig.recorder.channels)])
