"""The device behind all wires: recorder, error queue and the few settings that belong to reading out."""

from __future__ import annotations

import os
import select
import time
from collections.abc import Callable
from dataclasses import dataclass

from sim_device.acquisition import Setup, State
from sim_device.errors import Status
from sim_device.faults import Faults
from sim_device.memory import Memory
from sim_device.recorder import Recorder
from sim_device.settings import Rig
from sim_device.tower import Tower

IDENTITY = "droptower,emulated tower,0001,0.1.0"
CHANNELS = 1


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
        self.recorder = Recorder(memory, self.faults, lambda: self.tower.rig, seed, log)
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
