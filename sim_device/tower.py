"""The tower around the device: the dart and its release, the beam, the interlock in hardware."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from sim_device import gate
from sim_device.fall import Motion
from sim_device.faults import Faults
from sim_device.recorder import Recorder
from sim_device.settings import Rig, SettingError
from sim_device.stream import Drop
from sim_device.tap import Tap


class Refused(Exception):
    """The hardware does not do that now; the text says why."""


class Tower:
    """Rig, dart and door. One drop at a time."""

    def __init__(self, rig: Rig, faults: Faults, seed: int, log: Callable[[str], None]) -> None:
        """With the dart in its clamp."""
        self.rig = rig
        self.drops = 0
        self.last_truth: dict[str, Any] | None = None
        self.beam_free = True
        self.recorder: Recorder | None = None
        self._faults, self._seed, self._log = faults, seed, log
        self._drop: Drop | None = None
        self._preparing = False
        self._taps = 0

    @property
    def moving(self) -> bool:
        """Whether the dart is out of its clamp."""
        return self._drop is not None and self._drop.moving()

    @property
    def interlock(self) -> int:
        """Interlock bits: 0 door closed, 1 clamp holds the dart, 2 catcher on, 3 ready."""
        door, held = not self.rig.drop.door_open, not self.moving
        return door | held << 1 | self.rig.drop.catcher << 2 | (door and held) << 3

    async def release(self) -> tuple[int, dict[str, Any]]:
        """Let the dart go; answers with the drop's number and truth, while it still falls.

        Raises
        ------
        Refused
            Open door, or a dart that is not in its clamp.
        """
        if self.rig.drop.door_open:
            raise Refused("the interlock holds the dart: the door is open")
        if self.moving or self._preparing:
            raise Refused("the dart is not in its clamp: the last drop is not over")
        self._preparing = True
        try:
            number = self.drops + 1
            rng = np.random.default_rng((self._seed, 3, number))
            rig = replace(self.rig, specimen=self.rig.specimen.drawn(np.random.default_rng((self._seed, 4, number))))
            motion, edges = await asyncio.to_thread(_play, rig, rng)
            self.drops = number
            drop = Drop(number, rig, motion, float(time.monotonic_ns()), float(rng.random()), self._seed)
            if self.recorder is not None:
                self.recorder.released(drop)
            self._drop = drop
            self.last_truth = motion.truth() | {"E": rig.specimen.E_GPa * 1e9, "fail_N": rig.specimen.fail_N}
            self._log(f"drop {number}: {json.dumps(self.last_truth)}")
            self._schedule(drop, edges)
            return number, self.last_truth
        finally:
            self._preparing = False

    def tap(self, peak_N: float) -> None:
        """A tap on the tup of the dart in its clamp.

        Raises
        ------
        Refused
            A dart that is not in its clamp.
        """
        if self.moving or self._preparing:
            raise Refused("the dart is not in its clamp: the last drop is not over")
        if self.recorder is not None:
            self._taps += 1
            now = float(time.monotonic_ns())
            self.recorder.released(Drop(-self._taps, self.rig, Tap(self.rig, peak_N), now, 0.5, self._seed))

    def _schedule(self, drop: Drop, edges: list[gate.Edge]) -> None:
        loop = asyncio.get_running_loop()
        ahead = loop.time() - time.monotonic_ns() / 1e9

        def pass_beam(edge: gate.Edge) -> None:
            self.beam_free = edge.free
            if self._faults.strikes("gate_missing") is not None:
                self._log(f"drop {drop.number}: fault gate_missing")
            elif self.recorder is not None:
                fault = self._faults.strikes("gate_absurd")
                off = 0.0 if fault is None else fault.options["seconds"] * 1e9
                self.recorder.edge(drop.contact + edge.time * 1e9 + off, edge.free)

        def hang() -> None:
            self.beam_free = True
            self._log(f"drop {drop.number}: over")

        for edge in edges:
            loop.call_at(drop.contact / 1e9 + edge.time + ahead, pass_beam, edge)
        loop.call_at(drop.contact / 1e9 + drop.motion.over + ahead, hang)


def _play(rig: Rig, rng: np.random.Generator) -> tuple[Motion, list[gate.Edge]]:
    try:
        motion = Motion(rig)
        return motion, gate.edges(motion, rig.gate, rng)
    except ArithmeticError as error:
        raise SettingError(f"this drop cannot be played: {error}") from error
