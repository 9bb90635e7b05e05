"""The device behind all wires: recorder, error queue and the few settings that belong to reading out."""

from __future__ import annotations

import asyncio
import os
import select
import time
from collections.abc import Callable
from dataclasses import dataclass

from sim_device.acquisition import Setup, State
from sim_device.errors import Status
from sim_device.faults import Faults
from sim_device.memory import Memory, Record
from sim_device.recorder import Recorder
from sim_device.settings import Rig
from sim_device.stream import Counts
from sim_device.tower import Tower

IDENTITY = "droptower,emulated tower,0001,0.1.0"
OVERFLOWING = 17
"""Errors, one more than the queue takes."""


def log(text: str) -> None:
    """One line on stderr. A log that nobody takes any more, or not fast enough, stops nothing and loses the line."""
    try:
        if select.select([], [2], [], 0)[1]:
            os.write(2, f"{time.strftime('%H:%M:%S')} {text}\n".encode())
    except (OSError, ValueError):
        return


@dataclass
class Reading:
    """Settings of the readout, Modbus window and span as in the holding registers."""

    swapped: bool = False
    window_channel: int = 1
    window_start: int = 0
    span_channel: int = 1
    span_start: int = 0
    span_count: int = 0
    acknowledge_id: int = 0
    acknowledge_crc: int = 0


class Device:
    """One box, many wires. Methods raise DeviceError; who asks decides how to say so."""

    def __init__(self, memory: Memory, rig: Rig, seed: int) -> None:
        """Power on: the boot is counted before anything is served."""
        memory.started()
        self.memory = memory
        self.status = Status()
        self.faults = Faults()
        self.tower = Tower(rig, self.faults, seed, log)
        self.recorder = Recorder(memory, self.faults, lambda: self.tower.rig, seed, log, self.power_cycle)
        self.tower.recorder = self.recorder
        self.reading = Reading()
        self.links: list[Callable[[], None]] = []

    @property
    def condition(self) -> int:
        """Operation condition register."""
        return int(self.recorder.state)

    @property
    def held_id(self) -> int:
        """Id of the held record or 0."""
        return self.memory.held.id if self.memory.held is not None and self.recorder.state is State.HELD else 0

    @property
    def setup(self) -> Setup:
        """Settings of the acquisition."""
        return self.recorder.setup

    def struck(self, command: str) -> bool:
        """Faults that a request sets off; whether it goes unanswered."""
        if self.faults.strikes("error_overflow", command) is not None:
            for _ in range(OVERFLOWING):
                self.status.report(-222)
        if self.memory.held is not None and self.faults.strikes("overwritten", command) is not None:
            self.recorder.overwrite()
        if self.faults.strikes("device_reset", command) is None:
            return False
        asyncio.get_running_loop().call_soon(self.power_cycle)
        return True

    def read(self, command: str, record: Record, channel: int, start: int, count: int) -> Counts:
        """Samples of a record as a reply to ``command`` holds them."""
        if record.channels > 1 and self.faults.strikes("swapped_channels", command) is not None:
            channel = (channel + 1) % record.channels
        counts = record.samples[channel, start : start + count]
        return counts.byteswap() if self.faults.strikes("swapped_bytes", command) is not None else counts

    def span_crc(self, command: str, record: Record, channel: int, start: int, count: int) -> int:
        """CRC-32 of a span as a reply to ``command`` states it."""
        crc = record.crc(channel, start, count)
        return crc ^ 0xFFFFFFFF if self.faults.strikes("bad_crc32", command) is not None else crc

    def reset(self) -> None:
        """``*RST``."""
        self.recorder.reset()
        self.reading = Reading()

    def power_cycle(self) -> None:
        """Power off and on: links closed, settings lost, boot counter up; the held record stays."""
        for close in self.links:
            close()
        self.recorder.power_on()
        self.reading = Reading()
        self.status.__init__()
        self.memory.started()
        log(f"power off and on: boot {self.memory.boot}")
