"""What makes the recorder's trigger fire: the level on channel 1, the contact input, arming itself, or a fault."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable

from sim_device import stream
from sim_device.acquisition import Acquisition
from sim_device.faults import Faults
from sim_device.settings import Rig
from sim_device.stream import Drop

LOOK_AHEAD_NS = 250_000_000
"""How far ahead the comparator looks at noise alone, when its level lies within it."""


async def until(at: float) -> None:
    """Wait until ``at`` (ns of the monotonic clock)."""
    await asyncio.sleep(max(0.0, (at - time.monotonic_ns()) / 1e9))


class Trigger:
    """Waits for one trigger after another; the tower tells it of releases and of the beam."""

    def __init__(self, faults: Faults, rig: Callable[[], Rig], seed: int, log: Callable[[str], None]) -> None:
        """With no dart in the air."""
        self._faults, self._rig, self._seed, self._log = faults, rig, seed, log
        self.drop: Drop | None = None
        self._released = asyncio.Event()
        self._contact_input = asyncio.Event()

    def released(self, drop: Drop) -> None:
        """A dart was let go."""
        self.drop = drop
        self._released.set()

    def beam_broken(self) -> None:
        """The contact input sees the flag."""
        self._contact_input.set()

    async def wait(self, run: Acquisition) -> None:
        """Return when ``run`` has its trigger."""
        self._contact_input.clear()
        if (fault := self._faults.strikes("spurious_trigger")) is not None:
            await asyncio.sleep(fault.options["seconds"])
            now = float(time.monotonic_ns())
            run.trigger_index = run.index_at(now)
            if self._fired(run, now):
                return
        sources = {"INT": self._level, "IMM": self._at_once, "EXT": self._contact}
        await sources[run.setup.source](run)

    def _fired(self, run: Acquisition, at: float) -> bool:
        if self._faults.strikes("missing_trigger") is not None:
            self._log(f"record {run.id}: fault missing_trigger")
            return False
        run.trigger = at
        return True

    async def _at_once(self, run: Acquisition) -> None:
        run.trigger_index = run.setup.pretrigger
        if not self._fired(run, run.origin + run.setup.pretrigger * run.setup.interval_ns):
            await asyncio.Event().wait()

    async def _contact(self, run: Acquisition) -> None:
        while True:
            await self._contact_input.wait()
            self._contact_input.clear()
            if self._fired(run, run.edges[-1] if run.edges else float(time.monotonic_ns())):
                return

    async def _level(self, run: Acquisition) -> None:
        setup, h, last_drop = run.setup, run.setup.interval_ns, 0
        index = setup.pretrigger
        while True:
            self._released.clear()
            drop, rig = self.drop, self._rig()
            if drop is not None and drop.moving() and drop.number != last_drop:
                last_drop = drop.number
                from_index = max(index, run.index_at(drop.release)) - drop.index(run.origin, h)
                found = await asyncio.to_thread(drop.crossing, setup, from_index)
                if found is not None:
                    after = drop.since_contact(found, h)
                    if (fault := self._faults.strikes("early_trigger")) is not None:
                        after -= round(fault.options["seconds"] * 1e9 / h) * h
                    await until(drop.contact + after)
                    if self._fired(run, drop.contact + after):
                        run.drop, run.trigger_after_contact = drop, after
                        return
                await until(drop.contact + drop.motion.over * 1e9)
                index = run.index_at(time.monotonic_ns())
            elif stream.within_noise(rig, setup.level):
                length = LOOK_AHEAD_NS // h
                key = (self._seed, 1, run.id)
                found = await asyncio.to_thread(stream.quiet_crossing, rig, key, setup, index, length)
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
